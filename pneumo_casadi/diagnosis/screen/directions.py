"""Directions in which an effect changes the residuals where it is small, and at its usual size.

Shape parameters, on which nothing depends at first order where the effect vanishes, are tried on a
grid. A large effect may act in another direction than a small one, play wider than most strokes of
the command for one: the perturbations by effects of the usual size are tried as well.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.estimation.equation_error.balance_functions import (
    BalanceFunctions,
    any_sensor_effect,
)
from pneumo_casadi.estimation.equation_error.fit import default_residual_floor
from pneumo_casadi.estimation.equation_error.residuals import (
    effect_derivatives,
    undecimated_residuals,
)
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import FloatArray

#: Shape parameters are tried at these multiples of their starting values, ...
GRID = (1 / 3, 1.0, 3.0)
#: ... and those that may have either sign at these.
SIGNED_GRID = (-4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0)


@dataclass(frozen=True, eq=False)
class Direction:
    """The perturbation of the residuals by one effect, for one choice of its shape.

    Parameters
    ----------
    values : mapping of str to float
        Shape parameters held, by full name.
    names : tuple of str
        Parameters that `columns` belong to.
    columns : (rows, k) array
        Derivatives of the weighted residuals, scaled by the parameters' scales; those of the flow
        map last.
    lower, upper : (k,) array
        How far they may go from their null, scaled.
    null, scales : (k,) array
        Their values at null, and their scales.
    """

    values: Mapping[str, float]
    names: tuple[str, ...]
    columns: FloatArray
    lower: FloatArray
    upper: FloatArray
    null: FloatArray
    scales: FloatArray

    def at(self, step: FloatArray) -> Mapping[str, float]:
        """Return all values after a scaled step (k,) from null."""
        sizes = (self.null + step * self.scales).tolist()
        return {**self.values, **dict(zip(self.names, sizes, strict=True))}


def perturbation(study: Study, nominal: FittedModel, effect: Effect) -> tuple[Direction, ...]:
    """Return the directions of an effect at the nominal fit, one for each point of its grid."""
    axis = study.axis.with_effects(effect).with_parameters(dict(nominal.values)).at_null_values()
    model = BalanceFunctions(axis)
    at_null = _residuals_at_null(study, model)
    first = _direction(study, model, nominal, at_null, {}, ())
    names = model.effect_parameters
    silent = [n for n, c in zip(names, first.columns.T, strict=True) if not np.any(c)]
    starting = axis.at_starting_values().parameters
    sizes = {n: starting[n].value - axis.parameters[n].value for n in names}
    usual = {name: size for name, size in sizes.items() if size != 0}
    if len(silent) == len(names):  # felt at no size near null: nothing to choose a shape by
        return (first,)
    shapes = tuple(n for n in silent if starting[n].value != 0)
    starts = [starting[n].value for n in shapes]
    grids = [SIGNED_GRID if axis.parameters[n].lower < 0 else GRID for n in shapes]
    tried = [
        {
            name: float(
                np.clip(start * f, axis.parameters[name].lower, axis.parameters[name].upper)
            )
            for name, start, f in zip(shapes, starts, factors, strict=True)
        }
        for factors in itertools.product(*grids)
    ]
    if shapes and not _is_null(study, model, at_null, tried[-1]):
        at_null = [None] * len(at_null)
    grid = []
    for values in tried:
        if all(v == axis.parameters[n].value for n, v in values.items()):
            grid.append(_without(first, shapes, values))
        else:
            grid.append(_direction(study, model, nominal, at_null, values, shapes))
        if model.n_z:
            grid.append(_direction(study, model, nominal, at_null, values, shapes, usual))
    return tuple(grid)


def _residuals_at_null(study: Study, model: BalanceFunctions) -> list[FloatArray | None]:
    """Return the residuals of every record while the effect does nothing, whatever its shape.

    Effects of sensors are inverted as accurately as all variants of a step need, this one among
    them: there they are left open.
    """
    if any_sensor_effect(model.axis.effects):
        return [None] * len(study.smoothed[0])
    theta = model.axis.parameters.values
    return [undecimated_residuals(model, data, theta) for data in study.smoothed[0]]


def _is_null(
    study: Study,
    model: BalanceFunctions,
    at_null: Sequence[FloatArray | None],
    shape: Mapping[str, float],
) -> bool:
    """Return whether an effect at null does nothing in another shape either, as it should."""
    theta = model.axis.parameters.with_values(shape).values
    return all(
        known is None or np.allclose(undecimated_residuals(model, data, theta), known, 1e-9, 1e-12)
        for data, known in zip(study.smoothed[0], at_null, strict=True)
    )


def _without(direction: Direction, shapes: Sequence[str], values: Mapping[str, float]) -> Direction:
    kept = [i for i, name in enumerate(direction.names) if name not in shapes]
    names = tuple(direction.names[i] for i in kept)
    parts = ("columns", "lower", "upper", "null", "scales")
    return Direction(values, names, *(getattr(direction, part)[..., kept] for part in parts))


def _direction(
    study: Study,
    model: BalanceFunctions,
    nominal: FittedModel,
    at_null: Sequence[FloatArray | None],
    values: Mapping[str, float],
    shapes: Sequence[str],
    sizes: Mapping[str, float] | None = None,
) -> Direction:
    parameters = model.axis.parameters.with_values(values)
    names = tuple(name for name in model.effect_parameters if name not in shapes)
    parts = [
        effect_derivatives(model, data, parameters.values, names, sizes, known)[
            data.used(study.axis)
        ]
        for data, known in zip(study.smoothed[0], at_null, strict=True)
    ]
    items = parameters.select(names)
    rows = np.concatenate(parts) / row_weights(study, nominal)[:, None]
    anchor = study.anchor_with(model.axis.effects)
    if anchor is not None:
        c = anchor.coefficients(parameters, parameters.values)
        rows = np.vstack([rows, anchor.rows(c, names)])
    return Direction(
        values,
        names,
        rows * items.scales,
        (items.lower - items.values) / items.scales,
        (items.upper - items.values) / items.scales,
        items.values,
        items.scales,
    )


def row_weights(study: Study, fitted: FittedModel) -> FloatArray:
    """Return the standard deviation of every row that counts, record after record."""
    r = np.hstack(fitted.train)
    used = np.hstack(fitted.used_train)
    sigma = np.sqrt(
        (r**2 * used).sum(axis=1) / used.sum(axis=1) + default_residual_floor(study.axis) ** 2
    )
    return np.concatenate(
        [np.broadcast_to(sigma[:, None], mask.shape)[mask] for mask in fitted.used_train]
    )
