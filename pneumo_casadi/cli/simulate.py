"""The command ``simulate``: records of a case, or a random axis of the virtual bench."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from pneumo_casadi.cli.options import Debug, Json, Output, RecordSetName, report_folder
from pneumo_casadi.cli.parts.bench import record_case
from pneumo_casadi.cli.terminal import guarded, progress_bar, say
from pneumo_casadi.errors import CaseError


def simulate(
    case: Annotated[
        Path | None,
        typer.Argument(metavar="CASE", help="Folder with bench.json and records."),
    ] = None,
    parameters: Annotated[
        Path | None,
        typer.Option("--parameters", "-p", help="Folder or result.json of identify or diagnose."),
    ] = None,
    output: Output = None,
    json_file: Json = None,
    open_loop: Annotated[
        bool | None,
        typer.Option(
            "--open-loop/--closed-loop",
            help="Apply the recorded inputs, or simulate the controller on x_ref (the default).",
        ),
    ] = None,
    records: Annotated[
        RecordSetName | None,
        typer.Option(
            help="Records that give reference, inputs and initial state [default: validate]."
        ),
    ] = None,
    bench: Annotated[
        bool, typer.Option("--bench", help="Record a random axis of the virtual bench instead.")
    ] = False,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Bench: seed of axis, effect sizes and noise [default: 0]."),
    ] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME[:SEVERITY]", help="Bench: hidden effect; can be repeated."),
    ] = None,
    severity: Annotated[
        str | None,
        typer.Option(help="Bench: default severity (small, medium or large) [default: medium]."),
    ] = None,
    fs: Annotated[
        float | None, typer.Option(help="Bench: sampling frequency [Hz] [default: 1000].")
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="Bench: length of each record [s] [default: 20].")
    ] = None,
    debug: Debug = False,
) -> None:
    """Simulate the axis on the records of CASE and write CSV files.

    One file per record, with the columns of a case folder in SI units whatever the columns of the
    record are, goes to FOLDER/simulation (default: report/CASE-simulation). With --bench,
    FOLDER becomes a case folder instead (default: report/bench-SEED), recorded on a random axis
    of the virtual bench, whose equations are independent of the model; the labels go to --json.
    """
    with guarded(debug):
        from pneumo_casadi.runtime.json_files import write_json
        from pneumo_casadi.runtime.output_folder import check_result_file

        content: dict[str, Any]
        check_result_file(json_file, "seed" if bench else "files")
        if bench:
            if case is not None or parameters is not None:
                raise CaseError("--bench generates its own axis: leave out CASE and --parameters")
            loop = "--closed-loop" if open_loop is False else "--open-loop"
            _refuse({loop: open_loop, "--records": records}, "goes with CASE, not with --bench")
            number = seed or 0
            folder = output or Path("report") / f"bench-{number}"
            sizes = (severity or "medium", 1000.0 if fs is None else fs)
            length = 20.0 if duration is None else duration
            content = record_case(folder, number, effect or [], *sizes, length, json_file)
            say(str(folder))
        else:
            own = {"--seed": seed, "--severity": severity, "--fs": fs, "--duration": duration}
            if case is not None:
                _refuse({**own, "--effect": effect}, "goes with --bench")
            given = records or "validate"
            content = {"files": _simulate(case, parameters, output, given, not open_loop)}
        if json_file is not None:
            write_json(content, json_file)


def _refuse(options: Mapping[str, object], why: str) -> None:
    """Refuse the first of some options that would do nothing."""
    for name, value in options.items():
        if value is not None:
            raise CaseError(f"{name} {why}; leave it out")


def _simulate(
    case: Path | None,
    parameters: Path | None,
    output: Path | None,
    records: RecordSetName,
    closed_loop: bool,
) -> list[str]:
    from pneumo_casadi.data import read_case
    from pneumo_casadi.identification.read_result import read_axis
    from pneumo_casadi.identification.trajectory_file import RecordSet, simulate_case
    from pneumo_casadi.report.pages.write import write_simulations
    from pneumo_casadi.runtime.output_folder import OutputKind, check_replaceable

    if case is None or parameters is None:
        raise CaseError("simulate needs CASE and --parameters, or --bench to make a case")
    folder = report_folder(output, case, "-simulation")
    check_replaceable(folder, OutputKind.SIMULATION)
    read = read_case(case)
    axis = read_axis(parameters, read)
    with progress_bar() as report:
        runs = simulate_case(axis, read, RecordSet(records), closed_loop, report)
    paths = [str(path) for path in write_simulations(runs, folder)]
    for path in paths:
        say(path)
    return paths
