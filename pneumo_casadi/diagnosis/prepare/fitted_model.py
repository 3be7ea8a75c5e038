"""The axis of a study fitted to the balances, without effects and with some."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.diagnosis.prepare.credible import require_credible
from pneumo_casadi.diagnosis.prepare.starting_values import (
    cheapest,
    lightened,
    on_best_stairs,
    scanned,
    stairs_of,
)
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.fit import (
    MAX_ITERATIONS,
    default_residual_floor,
    fit_equation_error,
)
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import FloatArray

#: Errors in which a fit or its simulation may end; any other is a defect of the program.
FAULTS = (FitError, ModelError, ArithmeticError, np.linalg.LinAlgError)
#: Log-likelihood that ends a search: a twentieth of what another form of an effect must gain. ...
MIN_GAIN = 1.0
#: An effect that gains less than that is tried so many times larger too.
LARGER_STARTS = (10.0, 100.0, 1000.0)
#: How often the stairs of an effect are looked for, each time beside parameters that fit better.
MAX_CLIMBS = 4


@dataclass(frozen=True, eq=False)
class FittedModel:
    """One fit of the balances as plain numbers.

    Parameters
    ----------
    effects : tuple of str
        Names of the effects in the model.
    values, std : mapping of str to float
        All parameters; standard deviations of the free ones.
    cost : float
        See `EquationErrorResult`; infinite where residuals held out are no finite numbers.
    train, held_out : tuple of (ne, m) array
        Residuals by record [Pa/s, Pa/s, N], of a force-driven axis over the mass [m/s²].
    used_train, used_held_out : tuple of (ne, m) array of bool
        Rows that count.
    converged : bool
        Whether the fit settled.
    pace : float
        Decrease of the cost per iteration where the fit was cut short, else 0.
    """

    effects: tuple[str, ...]
    values: Mapping[str, float]
    std: Mapping[str, float]
    cost: float
    train: tuple[FloatArray, ...]
    held_out: tuple[FloatArray, ...]
    used_train: tuple[NDArray[np.bool_], ...]
    used_held_out: tuple[NDArray[np.bool_], ...]
    converged: bool
    pace: float = 0.0


def fit_model(
    study: Study,
    effects: Sequence[Effect],
    start: Mapping[str, float] | None = None,
    shapes: Sequence[Mapping[str, float]] = (),
    base: float | None = None,
    max_iterations: int = MAX_ITERATIONS,
    trials: Sequence[Mapping[str, float]] = (),
    credible: bool = True,
) -> FittedModel:
    """Fit the nominal axis with some effects to the balances; `refine_model` takes it to its end.

    Parameters
    ----------
    start : mapping of str to float, optional
        Values to begin at; effects that are not named there begin at their starting values.
    shapes : sequence of mapping, optional
        Values of shape parameters to begin at, in turn; the best fit counts.
    base : float, optional
        Cost of the fit to be improved. Where nothing is gained on it, effects are tried larger
        too: a back pressure that leaves the valves choked has no influence.
    max_iterations : int, optional
        Of every fit. One that is cut short, see `FittedModel.pace`, is not rejected yet.
    trials : sequence of mapping, optional
        Further values of the effects; the fit begins where its cost is least.
    credible : bool, optional
        Whether a fit that is not credible is rejected; see `require_credible`.
    """
    axis = study.axis.with_effects(*effects).at_starting_values()
    known = {name: value for name, value in (start or {}).items() if name in axis.parameters}
    axis = scanned(study, lightened(axis.with_parameters(known), known), known)
    new_stairs = [each for each in axis.effects if stairs_of(each).difference(known)]
    axis = on_best_stairs(study, axis, new_stairs)
    if trials:
        axis = cheapest(study, axis, [{}, *trials])
    # A start looked for at full size tells more than the shape that an effect near null promises.
    looked_for = {f"{effect.name}.{short}" for effect in axis.effects for short in effect.scanned}
    fitted = min(
        (
            _fit_with_recovery(study, axis.with_parameters(s), max_iterations)
            for s in _without(looked_for, shapes) or ({},)
        ),
        key=_cost,
    )
    fitted = _climbed(study, axis, fitted, new_stairs, max_iterations)
    if base is not None and effects and fitted.cost >= base - MIN_GAIN:
        new = [n for n in axis.parameters.free_names if "." in n and n not in known]
        fitted = _fit_from_larger_starts(study, axis, new, fitted)
    if not np.isfinite(fitted.cost):
        raise FitError("with the parameters fitted, the effect runs away in records held out")
    if credible and not fitted.pace:  # one cut short may pass through what is not credible
        require_credible(study, effects, fitted.values)
    return fitted


def _without(
    names: Collection[str], shapes: Sequence[Mapping[str, float]]
) -> list[dict[str, float]]:
    """Return shapes without the values of some parameters, each once."""
    left = [{name: value for name, value in s.items() if name not in names} for s in shapes]
    return [shape for i, shape in enumerate(left) if shape not in left[:i]]


def _climbed(
    study: Study,
    axis: Axis,
    fitted: FittedModel,
    effects: Sequence[Effect],
    max_iterations: int = MAX_ITERATIONS,
) -> FittedModel:
    """Return a fit from the best stairs beside what was fitted, and from those beside it again."""
    for _ in range(MAX_CLIMBS if any(effect.staircase for effect in effects) else 0):
        best = on_best_stairs(study, axis.with_parameters(dict(fitted.values)), effects)
        again = _fit(study, best, max_iterations=max_iterations, least_gain=MIN_GAIN)
        if again.cost >= fitted.cost - MIN_GAIN:
            break
        fitted = again
    return fitted


def _fit_from_larger_starts(
    study: Study, axis: Axis, names: Sequence[str], small: FittedModel
) -> FittedModel:
    """Return a fit from larger values of some parameters; the small one where none is better."""
    items = axis.parameters.select(names)
    for factor in LARGER_STARTS:
        larger = np.clip(items.values * factor, items.lower, items.upper)
        start = axis.with_parameters(dict(zip(names, larger.tolist(), strict=True)))
        again = _fit(study, start, least_gain=MIN_GAIN)
        if again.cost < small.cost - MIN_GAIN:
            return again
    return small


def _fit_with_recovery(study: Study, axis: Axis, max_iterations: int) -> FittedModel:
    """Fit; if a chamber's parameter ends at its bound, fit again from the geometric values.

    The bounds are a factor of 20 from the geometry: a fit that ends there has diverged.
    """
    least_gain = MIN_GAIN if axis.effects else None
    fitted = _fit(study, axis, max_iterations=max_iterations, least_gain=least_gain)
    items = [item for item in axis.parameters if item.free and item.name.startswith("X_s")]
    if all(item.lower < fitted.values[item.name] < item.upper for item in items):
        return fitted
    geometry = {item.name: item.scale for item in items}
    elsewhere = axis.with_parameters(geometry)
    again = _fit(study, elsewhere, max_iterations=max_iterations, least_gain=least_gain)
    return min(fitted, again, key=_cost)


def refine_model(study: Study, fitted: FittedModel, effects: Sequence[Effect]) -> FittedModel:
    """Return a fit taken to its minimum, with complete derivatives, effect parameters free.

    Parameters held so far distinguish the forms of an effect; they are estimated once the effect
    was accepted, and stay held if they gain little. Those on a staircase are scanned again. A fit
    that is not credible is rejected.
    """
    axis = study.axis.with_effects(*effects).with_parameters(dict(fitted.values))
    whole = bool(BalanceFunctions(axis).state_dependent)
    fitted = _better(study, effects, fitted, _fit(study, axis, whole=whole), 0.0)
    axis = axis.with_parameters(dict(fitted.values))
    fitted = _better(study, effects, fitted, _climbed(study, axis, fitted, effects), 0.0)
    axis = axis.with_parameters(dict(fitted.values))
    known = set(axis.parameters.free_names).union(*(stairs_of(effect) for effect in effects))
    held = [n for n in axis.parameters.names if "." in n and n not in known]
    if not held:
        return fitted
    released = axis.with_parameters(axis.parameters.release(*held))
    return _better(study, effects, fitted, _fit(study, released), study.criteria.form_gain)


def _better(
    study: Study,
    effects: Sequence[Effect],
    fitted: FittedModel,
    candidate: FittedModel,
    gain: float,
) -> FittedModel:
    """Return the candidate if it gains enough and is credible, else the fit."""
    if candidate.cost >= fitted.cost - gain:
        return fitted
    try:
        require_credible(study, effects, candidate.values)
    except FitError:
        return fitted
    return candidate


def _cost(fitted: FittedModel) -> float:
    return fitted.cost


def _fit(
    study: Study,
    axis: Axis,
    whole: bool = False,
    max_iterations: int = MAX_ITERATIONS,
    least_gain: float | None = None,
) -> FittedModel:
    train, held_out = study.smoothed
    result = fit_equation_error(
        axis,
        train,
        study.anchor_with(axis.effects),
        residual_floor=default_residual_floor(study.axis),
        state_derivatives=whole or any(effect.through_states for effect in axis.effects),
        max_iterations=max_iterations,
        least_gain=least_gain,
    )
    left = tuple(result.residuals_of(motion) for motion in held_out)
    with np.errstate(over="ignore"):
        finite = all(np.isfinite(np.square(part)).all() for part in left)
    return FittedModel(
        tuple(effect.name for effect in axis.effects),
        result.parameters.as_dict(),
        result.std,
        result.cost if finite else np.inf,
        result.residuals,
        left,
        result.used,
        tuple(motion.used(axis) for motion in held_out),
        result.converged,
        result.pace,
    )
