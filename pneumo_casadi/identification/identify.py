"""The main job in one call: from a case folder to parameters with intervals, validated."""

import json
import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from pneumo_casadi.data import Bench, Case, Recording, read_case
from pneumo_casadi.errors import CaseError, ModelError
from pneumo_casadi.estimation.output_error import (
    OutputErrorOptions,
    OutputErrorResult,
    fit_output_error,
)
from pneumo_casadi.estimation.uncertainty import Identifiability, Optimum, analyse_identifiability
from pneumo_casadi.estimation.wls import Prediction, WLSResult, cross_validate, fit_wls
from pneumo_casadi.identification.warnings import ResultWarning, result_warnings
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.servosystem import nominal_axis
from pneumo_casadi.runtime.presentation import Presentable
from pneumo_casadi.runtime.progress import Progress, no_progress, progress_range
from pneumo_casadi.runtime.threads import one_thread
from pneumo_casadi.validation import Validation, validate
from pneumo_casadi.valve import (
    PAPER_DEGREES,
    FlowForm,
    FlowMap,
    FlowModel,
    FormSelection,
    choose_flow_form,
    fit_iso6358,
    fit_polynomials,
    fit_spline,
    read_flow_map,
)

logger = logging.getLogger(__name__)


#: A force-driven axis has no chambers to hold it: over a whole record its open-loop position
#: drifts away with the square of the time, so it is fitted over windows of this length [s].
FORCE_WINDOW = 0.5

#: Shares of the work at which the stages begin.
_SHARES = {"flow": 0.0, "wls": 0.02, "output_error": 0.08, "validation": 0.65, "done": 1.0}


@dataclass(frozen=True, slots=True)
class IdentifyOptions:
    """What may be chosen in an identification.

    Parameters
    ----------
    flow_form : FlowForm, optional
        Form of the flow map; by default the one that `choose_flow_form` finds.
    degrees : tuple of int, optional
        Degrees of φ, ψ (u > 0) and ψ (u < 0) in eq. 12; by default chosen by cross-validation, or
        (7, 7, 4) as in the paper where `flow_form` asks for the polynomials.
    refine_flow : bool
        Whether the coefficients of the flow map are refined together with the parameters,
        anchored by its measured points.
    start, end : float, optional
        Part of each record to identify on [s, on its own clock]; by default all of it.
    output_error : OutputErrorOptions, optional
        Set-up of the output-error fit; by default whole records, or windows of 0.5 s for a
        force-driven axis in open loop.
    windows : tuple of float
        Lengths of the validation windows [s].
    identifiability : bool
        Whether it is worked out what informs each parameter, and what stands for what.

    Examples
    --------
    Eq. 12 with the degrees of the paper, on ten seconds of each record:

    >>> options = IdentifyOptions(FlowForm.POLYNOMIALS, degrees=(7, 7, 4), start=5.0, end=15.0)
    >>> options.refine_flow, options.windows
    (True, (0.1, 0.5, 2.0))
    """

    flow_form: FlowForm | None = None
    degrees: tuple[int, int, int] | None = None
    refine_flow: bool = True
    start: float | None = None
    end: float | None = None
    output_error: OutputErrorOptions | None = None
    windows: tuple[float, ...] = (0.1, 0.5, 2.0)
    identifiability: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Presentable):
    """An axis identified from a case, with all that a report needs.

    Parameters
    ----------
    case : Case
        What was measured.
    options : IdentifyOptions
        What was chosen, with the form of the flow map that was used.
    records : tuple of Recording
        Those used, cut as the options ask.
    flow_map : FlowMap or None
        Measured static map; None for a force-driven axis.
    flow : FlowModel or None
        The form fitted to the map alone, before any trajectory is seen.
    flow_selection : FormSelection or None
        How that form was chosen; None for a force-driven axis.
    wls : WLSResult
        Weighted least squares.
    output_error : OutputErrorResult
        Output error, started from `wls`.
    predictions : tuple of Prediction
        Flows and effort predicted by `wls` on the held-out records.
    validation : Validation or None
        Simulations beside the held-out records; None where the case has none.
    truth : mapping of str to float, or None
        True parameters where they are known: ``truth.json`` in the case folder.
    warnings : tuple of ResultWarning
        What the reader must know before using the numbers.
    identifiability : Identifiability or None
        Where it was asked for.
    seconds : float
        Time that it took.

    Examples
    --------
    With ``result = pc.identify(pc.example_case())``:

    >>> print(result.summary().splitlines()[0])
    Identification of table1: output error converged, cost ...; ... warnings (see .warnings)
    >>> frame = result.to_frame()
    >>> bool(abs(frame.output_error["M"] / frame.truth["M"] - 1) < 0.01)
    True
    """

    case: Case
    options: IdentifyOptions
    records: tuple[Recording, ...]
    flow_map: FlowMap | None
    flow: FlowModel | None
    flow_selection: FormSelection | None
    wls: WLSResult
    output_error: OutputErrorResult
    predictions: tuple[Prediction, ...]
    validation: Validation | None
    truth: Mapping[str, float] | None
    warnings: tuple[ResultWarning, ...]
    identifiability: Identifiability | None
    seconds: float

    @property
    def axis(self) -> Axis:
        """The identified axis."""
        return self.output_error.axis

    @property
    def headline(self) -> str:
        """Case, status of the fit, and how many warnings there are."""
        fit = self.output_error
        return (
            f"Identification of {self.case.name}: output error {fit.status}, cost {fit.cost:.5g}; "
            f"{len(self.warnings)} warnings (see .warnings)"
        )

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter: WLS and output error with robust std, truth if known [SI]."""
        wls, fit = self.wls.to_frame(), self.output_error.overview()
        frame = pd.DataFrame(
            {
                "wls": wls["estimate"],
                "wls_std": wls["std_hac"],
                "output_error": fit["estimate"].reindex(wls.index),
                "output_error_std": fit["std_robust"].reindex(wls.index),
                "unit": wls["unit"],
            }
        )
        if self.truth is not None:
            frame.insert(4, "truth", pd.Series(dict(self.truth)).reindex(frame.index))
        return frame


@one_thread
def identify(
    case: Case | str | Path,
    options: IdentifyOptions | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Identify an axis: flow map, weighted least squares, output error, validation.

    Parameters
    ----------
    case : Case or path
        A case, or the folder that holds one.
    options : IdentifyOptions, optional
        What differs from the default.
    progress : callable, optional
        Called as ``progress(text, share)`` with the share of the work done.

    Returns
    -------
    Identification

    Raises
    ------
    CaseError
        If the case cannot be read, or a servo axis has no flow map.
    FitError
        If a fit fails; ``.partial`` holds its result as far as it got.

    Examples
    --------
    With ``result = pc.identify(pc.example_case())``:

    >>> result.output_error.status, round(result.output_error.parameters["M"].value, 1)
    ('converged', 16.9)
    >>> result.to_frame().columns[:4].tolist()
    ['wls', 'wls_std', 'output_error', 'output_error_std']
    """
    began = time.perf_counter()
    options = options or IdentifyOptions()
    report = progress or no_progress
    case = case if isinstance(case, Case) else read_case(case)
    records = _cut(case.identify, options)
    report("flow map", _SHARES["flow"])
    options, selection = resolve_flow_form(case, options)
    flow_map, flow = read_flow(case, options)
    axis = make_axis(case, flow)
    if not options.refine_flow:
        axis = axis.with_parameters(axis.parameters.fix(*axis.flow_parameters))
    report("weighted least squares", _SHARES["wls"])
    wls = fit_wls(axis, records)
    chosen = output_error_options(case, options)
    fit = fit_output_error(
        axis.started_at(wls.parameters),
        records,
        flow_map,
        chosen,
        progress_range(report, _SHARES["output_error"], _SHARES["validation"], "output error: "),
    )
    predictions: tuple[Prediction, ...] = ()
    validation = None
    if case.validate:
        predictions = cross_validate(wls, case.validate)
        stage = progress_range(report, _SHARES["validation"], _SHARES["done"], "validation: ")
        validation = validate(fit.axis, case.validate, options.windows, stage)
    identification = Identification(
        case=case,
        options=options,
        records=records,
        flow_map=flow_map,
        flow=flow,
        flow_selection=selection,
        wls=wls,
        output_error=fit,
        predictions=predictions,
        validation=validation,
        truth=read_truth(case.folder),
        warnings=result_warnings(case, records, flow_map, wls, fit, validation, selection),
        identifiability=(
            analyse_identifiability(Optimum(fit, records, flow_map, chosen))
            if options.identifiability
            else None
        ),
        seconds=time.perf_counter() - began,
    )
    report("done", _SHARES["done"])
    return identification


def resolve_flow_form(
    case: Case, options: IdentifyOptions
) -> tuple[IdentifyOptions, FormSelection | None]:
    """Return the options with the form of the flow map decided, and how it was chosen.

    Returns
    -------
    tuple
        Options whose `flow_form` is not None, and the selection; the options as they are and None
        for a force-driven axis.

    Raises
    ------
    CaseError
        If a servo axis has no flow map, or no form can be fitted to it.
    """
    if not isinstance(case.bench, Bench):
        return options, None
    if options.flow_form is not None:
        selection = FormSelection.given(options.flow_form, options.degrees)
    else:
        table = _read_table(case, case.bench)
        selection = choose_flow_form(table, T=case.bench.T, degrees=options.degrees)
    return replace(options, flow_form=selection.chosen, degrees=selection.degrees), selection


def read_flow(case: Case, options: IdentifyOptions) -> tuple[FlowMap | None, FlowModel | None]:
    """Read the flow map of a servo axis and fit the form asked for, or the one chosen.

    Returns
    -------
    tuple
        Measured table and fitted model; None and None for a force-driven axis.

    Raises
    ------
    CaseError
        If a servo axis has no flow map.
    """
    if not isinstance(case.bench, Bench):  # no valves: nothing was metered
        return None, None
    chosen, _ = resolve_flow_form(case, options)
    assert chosen.flow_form is not None
    fits: dict[FlowForm, Callable[[FlowMap], FlowModel]] = {
        FlowForm.POLYNOMIALS: partial(fit_polynomials, degrees=chosen.degrees or PAPER_DEGREES),
        FlowForm.SPLINE: fit_spline,
        FlowForm.ISO6358: partial(fit_iso6358, T=case.bench.T),
    }
    table = _read_table(case, case.bench)
    return table, fits[chosen.flow_form](table)


def _read_table(case: Case, bench: Bench) -> FlowMap:
    if case.flow_map_path is None:
        raise CaseError(
            f"{case.folder}: no flow_map.csv; a servo axis cannot be identified without the "
            "static flow of its valve: meter q_m(u, p), columns u_V,p_Pa,q_m_kg_per_s"
        )
    return read_flow_map(case.flow_map_path, p_supply=bench.p_supply, p_ext=bench.p_ext)


def make_axis(case: Case, flow: FlowModel | None) -> Axis:
    """Make the nominal axis of a case, of the kind that its bench says."""
    try:
        return nominal_axis(case.bench, flow)
    except ModelError as error:
        raise ModelError(f"{case.folder}: {error}") from None


def output_error_options(case: Case, options: IdentifyOptions) -> OutputErrorOptions:
    """Return the set-up of the output-error fit for a case."""
    chosen = options.output_error or OutputErrorOptions()
    drifts = case.bench.kind.drifts_in_open_loop and not chosen.closed_loop
    if chosen.window is None and drifts:
        return replace(chosen, window=FORCE_WINDOW)
    return chosen


def read_truth(folder: Path) -> dict[str, float] | None:
    """Read the true parameters of a case where they are known (``truth.json``).

    Raises
    ------
    CaseError
        If the file is no JSON object of numbers.
    """
    path = folder / "truth.json"
    if not path.is_file():
        return None
    try:
        content: Any = json.loads(path.read_text("utf-8"))
        return {str(name): float(value) for name, value in content.items()}
    except (ValueError, TypeError, AttributeError) as error:
        raise CaseError(
            f'{path}: expected a JSON object of numbers, as {{"M": 16.9}} ({error})'
        ) from None


def _cut(records: tuple[Recording, ...], options: IdentifyOptions) -> tuple[Recording, ...]:
    if options.start is None and options.end is None:
        return records
    start = -float("inf") if options.start is None else options.start
    end = float("inf") if options.end is None else options.end
    return tuple(
        record.window(max(start, record.t[0]), min(end, record.t[-1] + record.dt))
        for record in records
    )
