"""What ``design`` does: a reference for the next experiment, and what it will gain."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from pneumo_casadi.cli.flow_option import Flow, FlowOption
from pneumo_casadi.cli.terminal import guarded, out, progress_bar
from pneumo_casadi.data import Bench, Case, read_case
from pneumo_casadi.design import (
    Criterion,
    Design,
    DesignOptions,
    Limits,
    default_limits,
    design_for_precision,
    design_to_separate,
    recorded_reference,
)
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import CaseError, FitError
from pneumo_casadi.estimation.output_error import OutputErrorResult, fit_output_error
from pneumo_casadi.identification.identify import (
    IdentifyOptions,
    identify,
    output_error_options,
)
from pneumo_casadi.identification.result_file import write_json
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.report.pages.design import design_text, write_design
from pneumo_casadi.report.pages.write import Kind, check_replaceable
from pneumo_casadi.runtime.progress import Progress, progress_range
from pneumo_casadi.valve import FlowForm, FlowMap

#: The axis without effects, among those to be told apart.
NONE = "none"
#: References tried for ten seconds of experiment; fewer for longer ones, so that time is kept.
PRECISION_TRIES, SEPARATION_TRIES, FEWEST = 240, 60, 40


@dataclass(frozen=True, slots=True)
class Asked:
    """What was asked for on the command line; None where a default is to be found."""

    separate: tuple[str, str] | None
    criterion: Criterion
    duration: float | None
    common: float
    velocity: float | None
    command: float | None
    tries: int | None
    seed: int
    flow: FlowForm | None


def design(
    case: Annotated[
        Path, typer.Argument(metavar="CASE", help="Folder with bench.json and records.")
    ],
    separate: Annotated[
        tuple[str, str] | None,
        typer.Option(
            metavar="EFFECT EFFECT", help="Tell these two apart; `none` is the nominal axis."
        ),
    ] = None,
    criterion: Annotated[
        Criterion,
        typer.Option(help="Of the covariance: volume (D), mean (A), worst direction (E)."),
    ] = Criterion.D,
    duration: Annotated[
        float | None, typer.Option(help="Length [s]; by default that of the record.")
    ] = None,
    common: Annotated[
        float,
        typer.Option(help="Largest command that may be added to both valves alike [V]."),
    ] = 0.0,
    velocity: Annotated[
        float | None,
        typer.Option(help="Fastest motion [m/s]; by default 1.5 times that of the records."),
    ] = None,
    command: Annotated[
        float | None,
        typer.Option(help="Largest command [V]; by default as far as the flow map was metered."),
    ] = None,
    flow: Flow = FlowOption.AUTO,
    tries: Annotated[
        int | None, typer.Option(min=20, help="References tried; by default some 240 or 60.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the search.")] = 0,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Where it goes.")
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write the prediction here.")
    ] = None,
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks and the log.")] = False,
) -> None:
    """Design the next experiment: for small standard errors, or to tell two effects apart.

    CASE is identified first; its record is what the design is compared with. FOLDER (default:
    report/CASE-design) gets reference.csv (t_s, x_ref_m and, with --common, u_common_V to be
    added to the command of both valves), design.txt, design.json and design.png.
    """
    with guarded(debug):
        folder = output or Path("report") / f"{case.resolve().name}-design"
        check_replaceable(folder, Kind.DESIGN)
        asked = Asked(
            separate, criterion, duration, common, velocity, command, tries, seed, flow.form
        )
        with progress_bar() as report:
            found, notes = designed(read_case(case), asked, report)
        write_design(found, folder, notes)
        if json_file is not None:
            write_json(found.as_dict(), json_file)
        out.print(design_text(found, notes), markup=False, soft_wrap=True)
        out.print(f"\nreference: {folder}/reference.csv", soft_wrap=True)


def designed(case: Case, asked: Asked, report: Progress) -> tuple[Design, list[str]]:
    """Identify a case and design its next experiment.

    Returns
    -------
    tuple
        The design, and notes for its reader.

    Raises
    ------
    CaseError
        If the case is no servo axis with a flow map, or an effect is unknown.
    FitError
        If the identification fails, or no reference keeps the limits.
    """
    if not isinstance(case.bench, Bench):
        raise CaseError(f"{case.folder}: experiments are designed for servo axes only")
    for name in asked.separate or ():
        if name != NONE and name not in EFFECTS:
            raise CaseError(f"no effect {name!r}; there are {', '.join(EFFECTS)} and {NONE}")
    if asked.separate is not None and asked.separate[0] == asked.separate[1]:
        raise CaseError(f"{asked.separate[0]} cannot be told from itself; name two effects")
    options = IdentifyOptions(flow_form=asked.flow)
    identified = identify(replace(case, validate=()), options, progress_range(report, 0.0, 0.3))
    fit, table = identified.output_error, identified.flow_map
    if table is None:
        raise CaseError(f"{case.folder}: no flow map")
    choices = _choices(case, case.bench, table, asked)
    recorded = [recorded_reference(record) for record in case.identify]
    notes: list[str] = []
    rest = progress_range(report, 0.4, 1.0, "design: ")
    if asked.separate is None:
        found = design_for_precision(
            fit.axis, recorded, table, fit.sigma, choices, asked.criterion, progress=rest
        )
    else:
        axes = _axes(asked.separate, fit, case, table, options, notes)
        found = design_to_separate(axes, fit.axis, recorded, table, fit.sigma, choices, rest)
    if found.gain < 1:
        notes.append(
            "No reference tried does better than what was recorded: allow more speed, pressure, "
            "time or a common mode, or try more references."
        )
    return found, notes


def _choices(case: Case, bench: Bench, table: FlowMap, asked: Asked) -> DesignOptions:
    metered = float(np.abs(table.u).max())
    limits: Limits = default_limits(bench, case.identify, metered, asked.common)
    if asked.velocity is not None:
        limits = replace(limits, velocity=asked.velocity)
    if asked.command is not None:
        limits = replace(limits, command=asked.command)
    duration = asked.duration or case.identify[0].duration
    most = PRECISION_TRIES if asked.separate is None else SEPARATION_TRIES
    tries = asked.tries or max(FEWEST, round(most * min(1.0, 10.0 / duration)))
    return DesignOptions(limits, duration, evaluations=tries, seed=asked.seed)


def _axes(
    names: tuple[str, str],
    fit: OutputErrorResult,
    case: Case,
    table: FlowMap,
    options: IdentifyOptions,
    notes: list[str],
) -> Mapping[str, Axis]:
    """Return the axis with each effect as a refit of the records finds it."""
    axes = {}
    for name in names:
        if name == NONE:
            axes[name] = fit.axis
            continue
        start = fit.axis.with_effects(EFFECTS[name]()).at_starting_values(name)
        axes[name] = start
        try:
            found = fit_output_error(
                start, case.identify, table, output_error_options(case, options)
            )
        except FitError:
            notes.append(f"{name}: the records do not fit; designed at its starting values.")
            continue
        if _informed(found, name):
            axes[name] = found.axis
        else:
            notes.append(f"{name}: the records show none of it; designed at its starting values.")
    return axes


def _informed(found: OutputErrorResult, name: str) -> bool:
    """Tell whether one of an effect's sizes lies three standard deviations from its null value."""
    sized = (one for one in found.parameters if one.name.startswith(f"{name}."))
    return any(
        one.start is not None
        and one.null is not None
        and abs(one.value - one.null) > 3 * found.std(one.name)
        for one in sized
    )
