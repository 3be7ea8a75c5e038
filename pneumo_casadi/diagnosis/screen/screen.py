"""The screen: what each effect could explain, from one linearisation at the nominal fit.

The perturbation that an effect causes along the smoothed motion is projected orthogonally to
everything that a refit of the nominal model would absorb. Shape parameters, on which nothing
depends at first order where the effect vanishes, are tried on a grid. A large effect may act in
another direction than a small one, play wider than most strokes of the command for one: the
perturbations by effects of the usual size are tried as well.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.fit import default_residual_floor
from pneumo_casadi.estimation.equation_error.problem import prior_rows
from pneumo_casadi.estimation.equation_error.residuals import (
    effect_derivatives,
    linearise_residuals,
)
from pneumo_casadi.estimation.gauss_newton import minimise_in_box
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import FloatArray

#: Shape parameters are tried at these multiples of their starting values, ...
GRID = (1 / 3, 1.0, 3.0)
#: ... and those that may have either sign at these.
SIGNED_GRID = (-4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0)
#: Below this share of its influence the direction of an effect is lost in rounding; at laboratory
#: noise little is enough.
ROUNDING = 1e-6


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


@dataclass(frozen=True, slots=True)
class ScreenResult:
    """What the screen promises of an effect.

    Parameters
    ----------
    name : str
        Effect.
    explained : float
        Share of the squared residuals that it takes away.
    gain : float
        Log-likelihood that it gains thereby, to second order.
    by_balance : (ne,) array
        The part of it in each balance.
    observable : float
        Share of its influence that the nominal parameters cannot take up.
    felt : bool
        Whether it has any influence where it is small: a back pressure that leaves the valves
        choked has none.
    starts : tuple of mapping of str to float
        Shapes from which a refit had better start, the most promising first: one for each sign
        that a shape may have.
    sizes : mapping of str to float
        Values of all its parameters where it would take away that share.
    """

    name: str
    explained: float
    gain: float
    by_balance: FloatArray
    observable: float
    felt: bool
    starts: tuple[Mapping[str, float], ...]
    sizes: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Background:
    """Residuals at a fit and a basis of what a refit would absorb.

    Those of the flow map are the last, and behind them those of the priors of its effects.

    Parameters
    ----------
    e : (rows,) array
        Residuals over the standard deviation that the fit leaves in their balance.
    Q : (rows, n) array
        Orthonormal.
    weight : (rows,) array
        By which the rows of a `Direction`, weighted as the nominal fit, are weighted as this one.
    of_balance : (ne, rows) array of bool
        Which rows belong to each balance.
    """

    e: FloatArray
    Q: FloatArray
    weight: FloatArray
    of_balance: NDArray[np.bool_]

    def weighted(self, direction: Direction) -> FloatArray:
        """Return the columns of a direction in these rows, zero in those of priors, (rows, k)."""
        missing = len(self.e) - len(direction.columns)
        return np.pad(direction.columns, ((0, missing), (0, 0))) * self.weight[:, None]


def perturbation(study: Study, nominal: FittedModel, effect: Effect) -> tuple[Direction, ...]:
    """Return the directions of an effect at the nominal fit, one for each point of its grid."""
    axis = study.axis.with_effects(effect).with_parameters(dict(nominal.values)).at_null_values()
    model = BalanceFunctions(axis)
    first = _direction(study, model, nominal, {}, ())
    names = model.effect_parameters
    silent = [n for n, c in zip(names, first.columns.T, strict=True) if not np.any(c)]
    starting = axis.at_starting_values().parameters
    sizes = {n: starting[n].value - axis.parameters[n].value for n in names}
    usual = {name: size for name, size in sizes.items() if size != 0}
    if len(silent) == len(names):  # felt at no size near null: nothing to choose a shape by
        return (first,)
    shapes = tuple(n for n in silent if starting[n].value != 0)
    starts = [starting[n].value for n in shapes]
    grid = []
    grids = [SIGNED_GRID if axis.parameters[n].lower < 0 else GRID for n in shapes]
    for factors in itertools.product(*grids):
        values = {
            name: float(
                np.clip(start * f, axis.parameters[name].lower, axis.parameters[name].upper)
            )
            for name, start, f in zip(shapes, starts, factors, strict=True)
        }
        if all(v == axis.parameters[n].value for n, v in values.items()):
            grid.append(_without(first, shapes, values))
        else:
            grid.append(_direction(study, model, nominal, values, shapes))
        if model.n_z:
            grid.append(_direction(study, model, nominal, values, shapes, usual))
    return tuple(grid)


def _without(direction: Direction, shapes: Sequence[str], values: Mapping[str, float]) -> Direction:
    kept = [i for i, name in enumerate(direction.names) if name not in shapes]
    names = tuple(direction.names[i] for i in kept)
    parts = ("columns", "lower", "upper", "null", "scales")
    return Direction(values, names, *(getattr(direction, part)[..., kept] for part in parts))


def _direction(
    study: Study,
    model: BalanceFunctions,
    nominal: FittedModel,
    values: Mapping[str, float],
    shapes: Sequence[str],
    sizes: Mapping[str, float] | None = None,
) -> Direction:
    parameters = model.axis.parameters.with_values(values)
    names = tuple(name for name in model.effect_parameters if name not in shapes)
    parts = [
        effect_derivatives(model, data, parameters.values, names, sizes)[data.used(study.axis)]
        for data in study.smoothed[0]
    ]
    items = parameters.select(names)
    rows = np.concatenate(parts) / _weights(study, nominal)[:, None]
    known = study.anchor_with(model.axis.effects)
    if known is not None:
        c = known.coefficients(parameters, parameters.values)
        rows = np.vstack([rows, known.rows(c, names)])
    return Direction(
        values,
        names,
        rows * items.scales,
        (items.lower - items.values) / items.scales,
        (items.upper - items.values) / items.scales,
        items.values,
        items.scales,
    )


def _weights(study: Study, fitted: FittedModel) -> FloatArray:
    """Return the standard deviation of every row that counts, record after record."""
    r = np.hstack(fitted.train)
    used = np.hstack(fitted.used_train)
    sigma = np.sqrt(
        (r**2 * used).sum(axis=1) / used.sum(axis=1) + default_residual_floor(study.axis) ** 2
    )
    return np.concatenate(
        [np.broadcast_to(sigma[:, None], mask.shape)[mask] for mask in fitted.used_train]
    )


def background(
    study: Study, nominal: FittedModel, fitted: FittedModel, effects: Sequence[Effect] = ()
) -> Background:
    """Linearise a fit and return its residuals with the space that a refit would absorb.

    Weighted by what the fit leaves: beside a large effect that was found, a small one counts by
    what is left. Half the squares that it takes away are then the log-likelihood that it gains.
    """
    axis = study.axis.with_effects(*effects).with_parameters(dict(fitted.values))
    model = BalanceFunctions(axis)
    theta = axis.parameters.values
    r, J, balance = [], [], []
    for data in study.smoothed[0]:
        linear, mask = linearise_residuals(model, data, theta), data.used(axis)
        balance.append(np.nonzero(mask)[0])
        r.append(linear.r[mask])
        J.append(linear.J[mask])
    weight = _weights(study, fitted)
    relative = _weights(study, nominal) / weight
    scales = axis.parameters.select(model.free).scales
    A = np.concatenate(J) * scales / weight[:, None]
    e = np.concatenate(r) / weight
    known = study.anchor_with(effects)
    if known is not None:
        c = known.coefficients(axis.parameters, theta)
        A = np.vstack([A, known.rows(c, model.free) * scales])
        e = np.concatenate([e, known(c)])
    prior = prior_rows(axis)
    free = [axis.parameters.index(name) for name in model.free]
    A = np.vstack([A, prior[:, free] * scales])
    e = np.concatenate([e, prior @ theta])
    relative = np.concatenate([relative, np.ones(len(e) - len(relative))])
    size = np.linalg.norm(A, axis=0)
    U, s, _ = np.linalg.svd(A / np.where(size > 0, size, 1.0), full_matrices=False)
    of_balance = np.zeros((len(axis.equations), len(e)), dtype=bool)
    which = np.concatenate(balance)
    of_balance[which, np.arange(len(which))] = True
    return Background(e, U[:, s > 1e-9 * s[0]], relative, of_balance)


def lost_likelihood(whole: Background, without: Background) -> float:
    """Return the log-likelihood that a fit loses without an effect, to second order.

    The other effects keep their values but for what a refit would absorb.
    """
    e = without.e - without.Q @ (without.Q.T @ without.e)
    return 0.5 * float(e @ e - whole.e @ whole.e)


def screened(name: str, candidates: Sequence[Direction], behind: Background) -> ScreenResult:
    """Return what an effect promises over a background."""
    promises = [(*_promise(direction, behind), direction) for direction in candidates]
    observable = max(seen for _, seen, _, _ in promises)
    promises.sort(key=lambda promise: -promise[0])
    starts: dict[tuple[bool, ...], Mapping[str, float]] = {}
    for _, _, _, direction in promises:
        values = direction.values
        starts.setdefault(tuple(value < 0 for value in values.values()), values)
    felt = any(np.any(direction.columns) for direction in candidates)
    explained, _, step, best = promises[0]
    gain = 0.5 * explained * float(behind.e @ behind.e)
    shapes = tuple(starts.values())
    change = behind.weighted(best) @ step
    after = behind.e + change - behind.Q @ (behind.Q.T @ change)
    parts = 0.5 * behind.of_balance @ (behind.e**2 - after**2)
    return ScreenResult(name, explained, gain, parts, observable, felt, shapes, best.at(step))


def _promise(direction: Direction, behind: Background) -> tuple[float, float, FloatArray]:
    """Return the shares explained and observable of one direction, and the scaled step."""
    e, Q, D = behind.e, behind.Q, behind.weighted(direction)
    gram = D.T @ D - (Q.T @ D).T @ (Q.T @ D)
    slope = D.T @ e - (Q.T @ D).T @ (Q.T @ e)
    whole = np.diag(D.T @ D)
    left = np.divide(np.diag(gram), whole, out=np.zeros(len(whole)), where=whole > 0)
    seen = left > ROUNDING
    observable = float(left.max(initial=0.0))
    step = np.zeros(len(whole))
    if not seen.any():
        return 0.0, observable, step
    both = np.ix_(seen, seen)
    step[seen] = minimise_in_box(
        gram[both], -slope[seen], direction.lower[seen], direction.upper[seen]
    )
    gain = -(2 * slope @ step + step @ gram @ step) / float(e @ e)
    return max(float(gain), 0.0), observable, step
