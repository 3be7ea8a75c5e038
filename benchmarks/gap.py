"""The gap to measurement on a held-out record, before and after a refit with a named effect.

Gap and closure are those of `pneumo_casadi.metrics`, in per cent; the gap of a view (closed loop,
or windows of 0.5 s in open loop) is that of p_P, p_N and x together. Initial states are estimated,
in closed loop from the first 2 s: where a play or a reservoir stands at the start is not measured.
"""

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pneumo_casadi.data import Case
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.output_error import (
    OutputErrorOptions,
    OutputErrorResult,
    fit_output_error,
)
from pneumo_casadi.estimation.wls import fit_wls
from pneumo_casadi.identification.flow_form import read_flow
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.starting_axis import make_axis
from pneumo_casadi.metrics import closure, combined_gap
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.validation.errors import loop_errors, window_errors
from pneumo_casadi.valve import FlowForm, FlowMap

#: Length of the open-loop windows on the held-out record [s].
WINDOW = 0.5
#: A gap is visible where it exceeds that without the effect so many times.
VISIBLE = 2.0
VIEWS = ("closed_loop", "windows")
#: ISO 6358 map refined with its metered points as anchor.
IDENTIFY = IdentifyOptions(flow_form=FlowForm.ISO6358)
#: One set-up for every fit, nominal or not: whole records, friction width 0.2 mm/s, and the loop
#: closed inside. In open loop a nominal axis that lacks a leak drifts away over a whole record, and
#: what is found says little; closed, it is the best that it can be in the view that is judged, so
#: that no refit is flattered.
OUTPUT_ERROR = OutputErrorOptions(closed_loop=True, widths=(2e-4,))


@dataclass(frozen=True, slots=True)
class Fitted:
    """One output-error fit as far as it got.

    Parameters
    ----------
    result : OutputErrorResult or None
        None where not even a partial result exists.
    failure : str
        Message of the failure; empty where the fit converged.
    """

    result: OutputErrorResult | None
    failure: str


def output_error(axis: Axis, case: Case, table: FlowMap | None) -> Fitted:
    """Fit an axis to a case; a fit that fails is a result too."""
    result: Any
    try:
        result, failure = fit_output_error(axis, case.identify, table, OUTPUT_ERROR), ""
    except FitError as error:
        partial_result = error.partial
        result = partial_result if isinstance(partial_result, OutputErrorResult) else None
        failure = str(error)
    return Fitted(result, failure)


def nominal(case: Case) -> tuple[Fitted, Axis, FlowMap | None]:
    """Fit the nominal axis; return the fit, the axis at the WLS estimate, and the metered map."""
    table, flow = read_flow(case, IDENTIFY)
    axis = make_axis(case, flow)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a clipped start is no news here
        start = axis.started_at(fit_wls(axis, case.identify).parameters)
    return output_error(start, case, table), start, table


def refit(effect: str, before: Fitted, start: Axis, case: Case, table: FlowMap | None) -> Fitted:
    """Fit the axis with an effect: begun at the nominal fit, or at WLS where that fails."""
    bases = [start] if before.result is None else [before.result.axis, start]
    for base in bases:
        axis = base.with_effects(EFFECTS[effect]()).at_starting_values()
        result = output_error(axis, case, table)
        if not result.failure:
            break
    return result


def held_out(fit: Fitted, case: Case) -> dict[str, Any] | None:
    """Return the gap of every output and view on the held-out record; None where none is finite.

    A fit without any result has none, nor has one whose simulations leave the finite numbers.
    """
    return None if fit.result is None else gaps(fit.result.axis, case)


def gaps(axis: Axis, case: Case) -> dict[str, Any] | None:
    """Return the gap of every output and view of an axis; None where no simulation is finite."""
    if axis.bench.controller is None:
        raise RuntimeError(f"{case.folder}: no controller to close the loop")
    try:
        shown = {
            "closed_loop": loop_errors(axis, case.validate, estimated=True),
            "windows": window_errors(axis, case.validate, WINDOW),
        }
    except (FitError, ModelError) as error:
        print(f"{case.name}: no gap: {error}", flush=True)
        return None
    views: dict[str, Any] = {}
    for view, errors in shown.items():
        outputs = {
            name: {
                "gap_percent": error.gap_percent,
                "noise_percent": error.noise_percent,
                "rms": error.rms,
            }
            for name, error in errors.items()
            if name in axis.outputs
        }
        overall = combined_gap([output["gap_percent"] for output in outputs.values()])
        views[view] = {"gap_percent": overall, **outputs}
    return views


def closed(before: Mapping[str, Any] | None, after: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the shares of the gaps that a refit closes [%], by view, over all outputs and each."""
    if before is None or after is None:
        return {}
    shares: dict[str, Any] = {}
    for view in VIEWS:
        result, other = before[view], after[view]
        shares[view] = {"all": share_closed(result["gap_percent"], other["gap_percent"])}
        for name in result:
            if name != "gap_percent":
                gaps = result[name]["gap_percent"], other[name]["gap_percent"]
                shares[view][name] = share_closed(*gaps)
    return shares


def share_closed(before: float, after: float) -> float | None:
    """Return the share of one gap that is closed [%]; None where there was none."""
    return None if before == 0 else 100 * closure(before, after)


def fit_figures(fit: Fitted) -> dict[str, Any]:
    """Return what is told of a fit besides its gap."""
    if fit.result is None:
        return {"failure": fit.failure}
    result = fit.result
    own = {
        name: {"value": result.parameters[name].value, "std": finite(result.std(name, True))}
        for name in result.parameters.names
        if "." in name
    }
    return {
        "failure": fit.failure or None,
        "iterations": result.iterations,
        "stages": len(result.stages),
        "effect_parameters": own,
    }


def finite(value: float) -> float | None:
    """Return a number that JSON can hold; None for infinite ones."""
    return value if math.isfinite(value) else None
