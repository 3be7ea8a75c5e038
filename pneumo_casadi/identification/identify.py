"""Identification in one call: from a case folder to validated parameters with intervals."""

import logging
import time
from collections.abc import Sequence
from pathlib import Path

from pneumo_casadi.data import Case, Recording, read_case
from pneumo_casadi.data.truth import read_truth
from pneumo_casadi.errors import CaseError, ModelError
from pneumo_casadi.estimation.output_error import (
    fit_each_record,
    fit_output_error,
)
from pneumo_casadi.estimation.uncertainty import Optimum, analyse_identifiability
from pneumo_casadi.estimation.wls import Prediction, WLSResult, cross_validate, fit_wls
from pneumo_casadi.identification.flow_form import read_flow, resolve_flow_form
from pneumo_casadi.identification.options import IdentifyOptions, output_error_options
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.identification.starting_axis import (
    axis_for_wls,
    axis_of_options,
    refuse_unscanned,
    start_of_output_error,
    with_flow_from_records,
)
from pneumo_casadi.identification.warnings import result_warnings
from pneumo_casadi.runtime.progress import Progress, no_progress, progress_range
from pneumo_casadi.runtime.threads import one_thread
from pneumo_casadi.validation import validate

logger = logging.getLogger(__name__)


#: Shares of the work at which the stages begin.
_SHARES = {
    "flow": 0.0,
    "wls": 0.02,
    "output_error": 0.08,
    "validation": 0.65,
    "each_record": 0.85,
    "done": 1.0,
}


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
        Called as ``progress(text, share)``, where `share` is the part of the work done, 0 to 1.

    Returns
    -------
    Identification

    Raises
    ------
    CaseError
        If the case cannot be read, or a servo axis has no flow map.
    ModelError
        If `options` are no `IdentifyOptions`, or choose what the axis has not.
    FitError
        If a fit fails; ``.partial`` holds its result as far as it got.

    Notes
    -----
    The example, 10 s at 5 kHz, takes less than a minute on one core.

    Examples
    --------
    With ``result = pc.identify(pc.example_case())``:

    >>> result.output_error.status, round(result.output_error.parameters["M"].value, 1)
    ('converged', 16.9)
    >>> result.to_frame().columns[:4].tolist()
    ['wls', 'wls_std', 'output_error', 'output_error_std']
    """
    began = time.perf_counter()
    options = IdentifyOptions() if options is None else options
    if not isinstance(options, IdentifyOptions):
        raise ModelError(f"options: {options!r}; give IdentifyOptions(...)")
    report = progress or no_progress
    case = case if isinstance(case, Case) else read_case(case)
    truth = read_truth(case.folder)  # refused before the work, not after it
    records = _cut(case.identify, options)
    report("flow map", _SHARES["flow"])
    options, selection = resolve_flow_form(case, options)
    flow_map, flow = read_flow(case, options, records)
    axis = axis_of_options(case, flow, options)
    refuse_unscanned(axis, options.fixed)
    axis = with_flow_from_records(axis, records)
    report("weighted least squares", _SHARES["wls"])
    wls = fit_wls(axis_for_wls(axis, options), records)
    chosen = output_error_options(case, options)
    fit = fit_output_error(
        start_of_output_error(axis, wls, options),
        records,
        flow_map,
        chosen,
        progress_range(report, _SHARES["output_error"], _SHARES["validation"], "output error: "),
    )
    alone = None
    if len(records) > 1 and options.each_record:
        stage = progress_range(report, _SHARES["validation"], _SHARES["each_record"], "alone: ")
        alone = fit_each_record(fit, records, chosen, stage)
    predictions: tuple[Prediction, ...] = ()
    validation = None
    if case.validate:
        predictions = _predictions(wls, case.validate)
        begun = _SHARES["validation"] if alone is None else _SHARES["each_record"]
        stage = progress_range(report, begun, _SHARES["done"], "validation: ")
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
        truth=truth,
        warnings=result_warnings(case, records, flow_map, wls, fit, validation, selection, alone),
        each_record=alone,
        identifiability=(
            analyse_identifiability(Optimum(fit, records, flow_map, chosen))
            if options.identifiability
            else None
        ),
        seconds=time.perf_counter() - began,
    )
    report("done", _SHARES["done"])
    return identification


def _predictions(wls: WLSResult, records: Sequence[Recording]) -> tuple[Prediction, ...]:
    """Return what WLS predicts; records too short for its filters are left out with a warning.

    The fits are done by then.
    """
    predictions: list[Prediction] = []
    for record in records:
        try:
            predictions += cross_validate(wls, record)
        except (CaseError, ModelError) as error:
            logger.warning("%s: not predicted by weighted least squares: %s", record.name, error)
    return tuple(predictions)


def _cut(records: tuple[Recording, ...], options: IdentifyOptions) -> tuple[Recording, ...]:
    """Return the part of each record; of one that gaps have split, the stretches that lie in it."""
    if options.start is None and options.end is None:
        return records
    start = -float("inf") if options.start is None else options.start
    end = float("inf") if options.end is None else options.end
    within = [start <= record.t[-2] and record.t[1] < end for record in records]
    kept = {record.source for record, holds in zip(records, within, strict=True) if holds}
    return tuple(
        record.window(max(start, record.t[0]), min(end, record.t[-1] + record.dt))
        for record, holds in zip(records, within, strict=True)
        if holds or record.source not in kept
    )
