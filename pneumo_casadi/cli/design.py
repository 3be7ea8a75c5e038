"""The command ``design``: a reference for the next experiment, and its predicted gain."""

from pathlib import Path
from typing import Annotated

import typer

from pneumo_casadi.cli.options import (
    CasePath,
    CriterionName,
    Debug,
    Flow,
    FlowOption,
    Json,
    Output,
    report_folder,
)
from pneumo_casadi.cli.terminal import guarded, progress_bar, say
from pneumo_casadi.errors import CaseError


def design(
    case: CasePath,
    parameters: Annotated[
        Path | None,
        typer.Option(
            "--parameters",
            "-p",
            metavar="RESULT",
            help="Begin from this result of identify or diagnose (its folder or result.json), with "
            "its effects; default: the nominal axis.",
        ),
    ] = None,
    separate: Annotated[
        tuple[str, str] | None,
        typer.Option(
            metavar="EFFECT EFFECT",
            help="Design to distinguish these two effects; none: the nominal axis.",
        ),
    ] = None,
    criterion: Annotated[
        CriterionName | None,
        typer.Option(
            help="Criterion of the covariance: determinant (D), trace (A), largest eigenvalue (E) "
            "[default: D]."
        ),
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(help="Duration of the reference [s]; default: that of the record."),
    ] = None,
    common: Annotated[
        float,
        typer.Option(help="Largest command added to both valves in common [V]."),
    ] = 0.0,
    velocity: Annotated[
        float | None,
        typer.Option(help="Largest velocity [m/s]; default: 1.5 times that of the records."),
    ] = None,
    command: Annotated[
        float | None,
        typer.Option(help="Largest command [V]; default: range of the flow map."),
    ] = None,
    flow: Flow = FlowOption.AUTO,
    tries: Annotated[
        int | None,
        typer.Option(
            min=20, help="Number of references tried; default: about 240, or 60 with --separate."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search.")] = 0,
    output: Output = None,
    json_file: Json = None,
    debug: Debug = False,
) -> None:
    """Design the next experiment: for small standard errors, or to distinguish two effects.

    CASE is identified first (with --parameters beginning from that result), and the design is
    compared with its record. FOLDER (default: report/CASE-design) gets reference.csv (t_s, x_ref_m
    and, with --common, u_common_V to be added to the command of both valves), design.txt,
    design.json, report.html and the figure as PNG, SVG and PDF.
    """
    with guarded(debug):
        from dataclasses import replace

        from pneumo_casadi.data import read_case
        from pneumo_casadi.design import Criterion, ExperimentRequest, design_experiment
        from pneumo_casadi.identification.identify import identify
        from pneumo_casadi.identification.options import IdentifyOptions
        from pneumo_casadi.identification.read_result import read_options
        from pneumo_casadi.report.pages.design import write_design
        from pneumo_casadi.report.text.design import design_text
        from pneumo_casadi.runtime.json_files import write_json
        from pneumo_casadi.runtime.output_folder import (
            OutputKind,
            check_replaceable,
            check_result_file,
        )
        from pneumo_casadi.runtime.progress import progress_range

        folder = report_folder(output, case, "-design")
        check_replaceable(folder, OutputKind.DESIGN)
        check_result_file(json_file, "evaluations")
        if parameters is not None and flow is not FlowOption.AUTO:
            raise CaseError("--flow: the form is that of --parameters; give one of the two")
        if separate is not None and criterion is not None:
            raise CaseError("--criterion: of standard errors; leave it out with --separate")
        request = ExperimentRequest(
            separate, Criterion(criterion or "D"), duration, common, velocity, command, tries, seed
        )
        read = replace(read_case(case), validate=())
        options = IdentifyOptions(flow_form=flow.form)
        if parameters is not None:
            options = read_options(parameters, read)
        with progress_bar() as report:
            result = identify(read, options, progress_range(report, 0.0, 0.3))
            rest = progress_range(report, 0.3, 0.95, "design: ")
            designed = design_experiment(result, request, rest)
            write_design(designed, folder, progress_range(report, 0.95, 1.0, "report: "))
        if json_file is not None:
            write_json(designed.as_dict(), json_file)
        say(design_text(designed))
        say(f"\nreference: {folder}/reference.csv")
        say(f"report: {folder}/report.html")
