"""Where fits of the balances begin: scans of what no step finds from afar."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.equation_error.fit import (
    default_residual_floor,
    equation_error_costs,
)
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import FloatArray

#: Share of M that is left to it where an effect begins with a mass of its own.
LEAST_RIGID = 0.5
#: Log-likelihood by which values on one stair differ, by rounding alone.
ONE_STAIR = 1e-6


def values_of(effect: str, values: Mapping[str, float]) -> dict[str, float]:
    """Return the parameters of one effect among those of a model, by their full names."""
    return {name: value for name, value in values.items() if name.startswith(f"{effect}.")}


def lightened(axis: Axis, known: Mapping[str, float]) -> Axis:
    """Return the axis with M less the masses with which new effects begin.

    M has carried them so far; with both, the start would miss more than the effect explains.
    """
    new = [f"{effect.name}.{short}" for effect in axis.effects for short in effect.masses]
    carried = sum(axis.parameters[name].value for name in new if name not in known)
    M = axis.parameters["M"]
    least = max(M.lower, LEAST_RIGID * M.value)
    return axis.with_parameters({"M": max(least, M.value - carried)}) if carried else axis


def scanned(study: Study, axis: Axis, known: Mapping[str, float]) -> Axis:
    """Return the axis at the best of the starts that its effects name; see `Effect.scanned`."""
    for effect in axis.effects:
        values = {f"{effect.name}.{short}": each for short, each in effect.scanned.items()}
        names = [name for name in values if name not in known]
        grid = itertools.product(*(values[name] for name in names))
        if names:
            axis = cheapest(study, axis, [dict(zip(names, at, strict=True)) for at in grid])
    return axis


def stairs_of(effect: Effect) -> set[str]:
    """Return the full names of the parameters that scans alone find."""
    return {f"{effect.name}.{short}" for short in effect.staircase}


def on_best_stairs(study: Study, axis: Axis, effects: Sequence[Effect]) -> Axis:
    """Return the axis at the best of the stairs that some effects name; see `Effect.staircase`.

    In the middle of a stair: its edges may be those of these records alone.
    """
    for effect in effects:
        for short in effect.staircase:
            own = values_of(effect.name, axis.parameters.as_dict())
            values = effect.stairs({name.split(".")[1]: value for name, value in own.items()})
            name, tried = f"{effect.name}.{short}", np.sort(values.get(short, ()))
            if not tried.size:
                raise ModelError(f"effect {effect.name}: `stairs` gives no values of {short}")
            costs = _costs(study, axis, [{name: value} for value in tried.tolist()])
            best = tried[costs <= costs.min() + ONE_STAIR]
            middle = best[np.argmin(np.abs(best - (best[0] + best[-1]) / 2))]
            axis = axis.with_parameters({name: float(middle)})
    return axis


def cheapest(study: Study, axis: Axis, changes: Sequence[Mapping[str, float]]) -> Axis:
    """Return the axis with those of several values that cost least once the others gave way.

    Where none has a cost, the first.
    """
    return axis.with_parameters(changes[int(np.argmin(_costs(study, axis, changes)))])


def _costs(study: Study, axis: Axis, changes: Sequence[Mapping[str, float]]) -> FloatArray:
    """Return costs at some values of effects, after one linear step of what is known so far.

    All parameters of these effects keep their values, all others give way; see `ProjectedCosts`.
    """
    tried = {name.split(".")[0] for values in changes for name in values}
    starts = np.tile(axis.parameters.values, (len(changes), 1))
    for start, values in zip(starts, changes, strict=True):
        start[[axis.parameters.index(name) for name in values]] = list(values.values())
    return np.array(
        equation_error_costs(
            axis,
            list(starts),
            study.smoothed[0],
            study.anchor_with(axis.effects),
            residual_floor=default_residual_floor(study.axis),
            state_derivatives=any(effect.through_states for effect in axis.effects),
            held=[name for name in axis.parameters.free_names if name.split(".")[0] in tried],
        )
    )
