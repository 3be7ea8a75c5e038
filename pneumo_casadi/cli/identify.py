"""The commands ``identify`` and ``demo``."""

from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated

import typer

from pneumo_casadi.cli.options import (
    CasePath,
    Debug,
    Degrees,
    Flow,
    FlowOption,
    Json,
    Output,
    Strict,
    degrees_of,
    report_folder,
    time_and_values,
    values_of,
)
from pneumo_casadi.cli.terminal import (
    exit_unless_usable,
    guarded,
    progress_bar,
    say,
    show,
    width,
)

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from pneumo_casadi.identification.options import IdentifyOptions
    from pneumo_casadi.identification.warnings import Usable

#: What workers import that draw figures.
FIGURES = "pneumo_casadi.report.pages.identification_figures"
#: As many of them: they wait for the fit, and hold some 150 MB each.
MOST_DRAWING = 2

Start = Annotated[
    list[str] | None,
    typer.Option(
        "--start",
        metavar="TIME|NAME=VALUE",
        help="TIME: identify on the part of each record from this time on [s, on its own clock]. "
        "NAME=VALUE: start output error at this value [SI], as k_P=1.2; can be repeated.",
    ),
]
End = Annotated[
    float | None,
    typer.Option(
        "--end",
        help="Identify on the part of each record up to this time [s, on its own clock]; with "
        "several records, each is cut.",
    ),
]
With = Annotated[
    list[str] | None,
    typer.Option(
        "--with", metavar="EFFECT", help="Add this effect of the catalogue; can be repeated."
    ),
]
Fix = Annotated[
    list[str] | None,
    typer.Option(
        "--fix",
        metavar="NAME=VALUE",
        help="Hold a parameter at this value [SI], as M=16.4; can be repeated.",
    ),
]

FrictionWidth = Annotated[
    float | None,
    typer.Option(
        "--friction-width",
        min=1e-7,
        max=0.1,
        help="Speed within which output error smooths Coulomb friction [m/s]; default 1e-4. Less "
        "has less bias and takes longer.",
    ),
]


def demo(
    output: Output = Path("report/demo"), json_file: Json = None, debug: Debug = False
) -> None:
    """Identify the example record, whose true parameters are known, and write the report.

    The simulated axis has the parameters of Table 1 of the paper (Identification of physical
    parameters of a pneumatic servosystem, IFAC 2005). The table shows weighted least squares (WLS),
    output error (OE), truth and Table 1.
    """
    with guarded(debug):
        from pneumo_casadi.data import EXAMPLE
        from pneumo_casadi.identification.options import IdentifyOptions
        from pneumo_casadi.valve import PAPER_DEGREES, FlowForm

        as_published = IdentifyOptions(FlowForm.POLYNOMIALS, PAPER_DEGREES)
        _identify(EXAMPLE, as_published, output or Path("report/demo"), json_file, paper=True)


def identify(
    case: CasePath,
    output: Output = None,
    json_file: Json = None,
    start: Start = None,
    end: End = None,
    effects: With = None,
    fix: Fix = None,
    flow: Flow = FlowOption.AUTO,
    degrees: Degrees = None,
    fixed_map: Annotated[
        bool, typer.Option("--fixed-map", help="Do not refine the flow map.")
    ] = False,
    window: Annotated[
        float | None,
        typer.Option(
            help="Length of shooting windows with own initial states [s]; default: whole record; "
            "0.5 s for an axis driven by force or pressures; what the data bear for long records."
        ),
    ] = None,
    friction_width: FrictionWidth = None,
    ipopt: Annotated[
        bool, typer.Option("--ipopt", help="Solve with IPOPT (slower, same optimum).")
    ] = False,
    closed_loop: Annotated[
        bool,
        typer.Option(
            "--closed-loop", help="Simulate the controller instead of using the recorded u."
        ),
    ] = False,
    identifiability: Annotated[
        bool,
        typer.Option(
            "--identifiability", help="Report the sources of information on each parameter."
        ),
    ] = False,
    each_record: Annotated[
        bool,
        typer.Option(
            "--each-record/--together",
            help="With several records, also fit each one alone (of more than ten, groups), and "
            "compare the estimates.",
        ),
    ] = True,
    strict: Strict = False,
    paper: Annotated[
        bool,
        typer.Option("--paper", help="Show Table 1 of the paper (IFAC 2005) beside the result."),
    ] = False,
    debug: Debug = False,
) -> None:
    """Identify an axis: weighted least squares, output error, validation on held-out records.

    CASE holds bench.json, identify*.csv[.gz], validate*.csv[.gz] and flow_map.csv (or is the
    folder of the EMPS benchmark). The report goes to report/CASE unless --output says otherwise.
    """
    with guarded(debug):
        from pneumo_casadi.estimation.output_error import Method, OutputErrorOptions, narrowed_to
        from pneumo_casadi.identification.options import IdentifyOptions

        time, start_values = time_and_values(start or [])
        options = IdentifyOptions(
            flow_form=flow.form,
            degrees=degrees_of(degrees),
            refine_flow=not fixed_map,
            start=time,
            end=end,
            identifiability=identifiability,
            effects=tuple(effects or ()),
            fixed=values_of("--fix", fix or []),
            start_values=start_values,
            each_record=each_record,
            output_error=OutputErrorOptions(
                method=Method.IPOPT if ipopt else Method.GAUSS_NEWTON,
                window=window,
                closed_loop=closed_loop,
                widths=narrowed_to(friction_width),
            ),
        )
        folder = report_folder(output, case)
        exit_unless_usable(_identify(case, options, folder, json_file, paper), strict)


def _identify(
    case: Path, options: "IdentifyOptions", folder: Path, json_file: Path | None, paper: bool
) -> "Usable":
    from pneumo_casadi.report.pages.drawing import matplotlib_installed
    from pneumo_casadi.runtime.output_folder import OutputKind, check_replaceable, check_result_file
    from pneumo_casadi.runtime.processes import default_workers, processes

    check_replaceable(folder, OutputKind.IDENTIFICATION)
    check_result_file(json_file, "wls")
    workers = min(MOST_DRAWING, default_workers()) if matplotlib_installed() else 1
    # Workers, which draw figures, import what they need while this process does.
    with processes(workers, (FIGURES,)) as executor:
        return _identify_with(executor, case, options, folder, json_file, paper)


def _identify_with(
    executor: "Executor | None",
    case: Path,
    options: "IdentifyOptions",
    folder: Path,
    json_file: Path | None,
    paper: bool,
) -> "Usable":
    from pneumo_casadi.identification.identify import identify
    from pneumo_casadi.identification.result_file import result_dict
    from pneumo_casadi.report.pages.write import write_identification
    from pneumo_casadi.report.tables.parameters import parameter_table, record_table
    from pneumo_casadi.report.tables.table import with_symbols
    from pneumo_casadi.report.tables.validation import validation_table
    from pneumo_casadi.report.text.identification import render_warnings
    from pneumo_casadi.runtime.json_files import write_json
    from pneumo_casadi.runtime.progress import progress_range

    with progress_bar() as report:
        result = identify(case, options, progress_range(report, 0.0, 0.8))
        rest = progress_range(report, 0.8, 1.0)
        write_identification(result, folder, paper, rest, executor)
    if json_file is not None:
        write_json(result_dict(result), json_file)
    say(fill(with_symbols(result.usability.sentence), min(width(), 100)))
    say()
    show(parameter_table(result, paper))
    if result.each_record is not None:
        say()
        show(record_table(result))
    if result.validation is not None:
        say()
        show(validation_table(result.validation))
    say()
    say(render_warnings(result.warnings, min(width(), 100)))
    say(f"\nreport: {folder}/report.html")
    return result.usability.usable
