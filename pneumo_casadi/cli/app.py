"""The command line: demo, identify, validate, diagnose, simulate, export, design, withheld."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import typer

from pneumo_casadi import __version__
from pneumo_casadi.cli.batch_command import diagnose_many_command
from pneumo_casadi.cli.bench_command import record_case
from pneumo_casadi.cli.design_command import design
from pneumo_casadi.cli.diagnose_command import diagnose_command
from pneumo_casadi.cli.export_command import export
from pneumo_casadi.cli.flow_option import Degrees, Flow, FlowOption, degrees_of
from pneumo_casadi.cli.terminal import BAD_INPUT, OK, complain, guarded, out, progress_bar, show
from pneumo_casadi.cli.withheld_command import withheld
from pneumo_casadi.data import read_case
from pneumo_casadi.errors import CaseError
from pneumo_casadi.estimation.output_error import Method, OutputErrorOptions
from pneumo_casadi.identification.identify import IdentifyOptions, identify
from pneumo_casadi.identification.result_file import (
    read_axis,
    result_dict,
    validation_dict,
    write_json,
)
from pneumo_casadi.identification.trajectory_file import RecordSet, simulate_case
from pneumo_casadi.report.pages.write import (
    Kind,
    check_replaceable,
    write_report,
    write_simulations,
    write_validation,
)
from pneumo_casadi.report.tables.results import parameter_table, validation_table
from pneumo_casadi.report.text.identification import render_warnings
from pneumo_casadi.runtime.progress import progress_range
from pneumo_casadi.validation import validate as validate_axis
from pneumo_casadi.valve import PAPER_DEGREES, FlowForm

app = typer.Typer(
    help="Identify pneumatic servo axes: from recordings to physical parameters with intervals.",
    epilog="Exit codes: 0 done, 1 a fit failed, 2 bad input or usage, 130 interrupted.",
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
)
CasePath = Annotated[
    Path, typer.Argument(metavar="CASE", help="Folder with bench.json and records.")
]
Parameters = Annotated[
    Path, typer.Option("--parameters", "-p", help="result.json written by identify.")
]
Output = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Where the report goes.")
]
Json = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Also write the result here as JSON.")
]
Debug = Annotated[bool, typer.Option("--debug", help="Show tracebacks and the log.")]
Start = Annotated[
    float | None, typer.Option("--start", help="Identify on the records from this time on [s].")
]
End = Annotated[
    float | None, typer.Option("--end", help="Identify on the records up to this time [s].")
]


def _version(wanted: bool) -> None:
    if wanted:
        out.print(f"pneumo-casadi {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Identify pneumatic servo axes: from recordings to physical parameters with intervals."""


@app.command()
def demo(
    output: Output = Path("report/demo"), json_file: Json = None, debug: Debug = False
) -> None:
    """Identify an embedded record whose true parameters are known, and write the report.

    The axis has the parameters of the paper's Table 1; the table shows weighted least squares
    (WLS), output error (OE), the truth and Table 1 side by side.
    """
    with guarded(debug), _embedded_case() as folder:
        as_published = IdentifyOptions(FlowForm.POLYNOMIALS, PAPER_DEGREES)
        _identify(folder, as_published, output or Path("report/demo"), json_file, paper=True)


@app.command("identify")
def identify_command(
    case: CasePath,
    output: Output = None,
    json_file: Json = None,
    start: Start = None,
    end: End = None,
    flow: Flow = FlowOption.AUTO,
    degrees: Degrees = None,
    fixed_map: Annotated[
        bool, typer.Option("--fixed-map", help="Keep the flow map as metered.")
    ] = False,
    window: Annotated[
        float | None,
        typer.Option(help="Longest stretch with one initial state [s]; default: whole record."),
    ] = None,
    ipopt: Annotated[
        bool, typer.Option("--ipopt", help="Solve with IPOPT (slower, same optimum).")
    ] = False,
    closed_loop: Annotated[
        bool,
        typer.Option("--closed-loop", help="Simulate the controller instead of taking u as is."),
    ] = False,
    identifiability: Annotated[
        bool,
        typer.Option("--identifiability", help="Report what informs each parameter."),
    ] = False,
    paper: Annotated[
        bool, typer.Option("--paper", help="Set the paper's Table 1 beside the result.")
    ] = False,
    debug: Debug = False,
) -> None:
    """Identify an axis: weighted least squares, output error, held-out validation.

    CASE holds bench.json, identify*.csv[.gz], validate*.csv[.gz] and flow_map.csv (or is the
    folder of the EMPS benchmark). The report goes to report/CASE unless --output says otherwise.
    """
    with guarded(debug):
        options = IdentifyOptions(
            flow_form=flow.form,
            degrees=degrees_of(degrees),
            refine_flow=not fixed_map,
            start=start,
            end=end,
            identifiability=identifiability,
            output_error=OutputErrorOptions(
                method=Method.IPOPT if ipopt else Method.GAUSS_NEWTON,
                window=window,
                closed_loop=closed_loop,
            ),
        )
        folder = output or Path("report") / case.resolve().name
        _identify(case, options, folder, json_file, paper)


@app.command()
def validate(
    case: CasePath,
    parameters: Parameters,
    output: Output = None,
    json_file: Json = None,
    debug: Debug = False,
) -> None:
    """Compare simulations with the held-out records of CASE, parameters as identified before.

    Open loop and closed loop over whole records, and windows of 0.1, 0.5 and 2 s.
    """
    with guarded(debug):
        if output is not None:
            check_replaceable(output, Kind.VALIDATION)
        found = read_case(case)
        axis = read_axis(parameters, found)
        if not found.validate:
            raise CaseError(f"{case}: no held-out record; add validate.csv or validate.csv.gz")
        with progress_bar() as report:
            validation = validate_axis(axis, found.validate, progress=report)
        show(validation_table(validation))
        if output is not None:
            write_validation(validation, axis, output)
            out.print(f"\nreport: {output}")
        if json_file is not None:
            write_json({"validation": validation_dict(validation)}, json_file)


@app.command()
def simulate(
    case: Annotated[
        Path | None,
        typer.Argument(metavar="CASE", help="Folder with bench.json and records."),
    ] = None,
    parameters: Annotated[
        Path | None,
        typer.Option("--parameters", "-p", help="result.json written by identify."),
    ] = None,
    output: Output = None,
    json_file: Json = None,
    open_loop: Annotated[
        bool,
        typer.Option(
            "--open-loop/--closed-loop", help="Recorded inputs, or the controller on x_ref."
        ),
    ] = False,
    records: Annotated[
        RecordSet, typer.Option(help="Whose reference, inputs and initial state are taken.")
    ] = RecordSet.VALIDATE,
    bench: Annotated[
        bool, typer.Option("--bench", help="Record a random axis on the virtual bench instead.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Bench: of axis, sizes, noise.")] = 0,
    effect: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME[:SEVERITY]", help="Bench: hidden effect; may be repeated."),
    ] = None,
    severity: Annotated[str, typer.Option(help="Bench: small, medium or large.")] = "medium",
    fs: Annotated[float, typer.Option(help="Bench: sampling frequency [Hz].")] = 1000.0,
    duration: Annotated[float, typer.Option(help="Bench: length of each record [s].")] = 20.0,
    debug: Debug = False,
) -> None:
    """Simulate the axis on the records of CASE and write CSV files in case-folder columns.

    One file a record goes to FOLDER/simulation (default: report/CASE-simulation). With --bench,
    FOLDER becomes a case folder instead (default: report/bench-SEED), recorded on a random axis
    by the virtual bench, which shares no equation with the model; the labels go to --json.
    """
    with guarded(debug):
        if bench:
            if case is not None or parameters is not None:
                raise CaseError("--bench makes an axis of its own: leave out CASE and --parameters")
            folder = output or Path("report") / f"bench-{seed}"
            found = record_case(folder, seed, effect or [], severity, fs, duration, json_file)
            out.print(folder, soft_wrap=True)
        else:
            found = {"files": _simulate(case, parameters, output, records, open_loop)}
        if json_file is not None:
            write_json(found, json_file)


app.command("diagnose")(diagnose_command)
app.command("diagnose-many")(diagnose_many_command)
app.command()(export)
app.command()(withheld)
app.command()(design)


def _simulate(
    case: Path | None,
    parameters: Path | None,
    output: Path | None,
    records: RecordSet,
    open_loop: bool,
) -> list[str]:
    if case is None or parameters is None:
        raise CaseError("simulate needs CASE and --parameters, or --bench to make a case")
    folder = output or Path("report") / f"{case.resolve().name}-simulation"
    check_replaceable(folder, Kind.SIMULATION)
    found = read_case(case)
    axis = read_axis(parameters, found)
    with progress_bar() as report:
        runs = simulate_case(axis, found, records, not open_loop, report)
    paths = write_simulations(runs, folder)
    for path in paths:
        out.print(path, soft_wrap=True)
    return [str(path) for path in paths]


def _identify(
    case: Path, options: IdentifyOptions, folder: Path, json_file: Path | None, paper: bool
) -> None:
    check_replaceable(folder, Kind.IDENTIFICATION)
    with progress_bar() as report:
        found = identify(case, options, progress_range(report, 0.0, 0.8))
        write_report(found, folder, paper, progress_range(report, 0.8, 1.0))
    if json_file is not None:
        write_json(result_dict(found), json_file)
    show(parameter_table(found, paper))
    if found.validation is not None:
        out.print()
        show(validation_table(found.validation))
    out.print()
    out.print(render_warnings(found.warnings, min(out.width, 100)), markup=False, soft_wrap=True)
    out.print(f"\nreport: {folder}/report.html", soft_wrap=True)


@contextmanager
def _embedded_case() -> Iterator[Path]:
    source = resources.files("pneumo_casadi") / "data" / "examples" / "table1"
    with resources.as_file(source) as folder:
        yield folder


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    command: Any = app
    try:
        code = command(
            args=None if arguments is None else list(arguments),
            prog_name="pneumo-casadi",
            standalone_mode=False,
        )
    except Exception as error:
        # Errors of usage carry their own exit code and message; anything else is a defect.
        message = getattr(error, "format_message", None)
        if message is None:
            raise
        complain(f"{message()} Try pneumo-casadi --help.")
        return BAD_INPUT
    return int(code or OK)


def main() -> None:
    """Entry point of ``pneumo-casadi``."""
    sys.exit(run())
