"""The screen: what each effect could explain, from one linearisation at the nominal fit.

The perturbation that an effect causes along the smoothed motion is projected orthogonally to
everything that a refit of the nominal model would absorb.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.diagnosis.screen.background import Background
from pneumo_casadi.diagnosis.screen.directions import Direction
from pneumo_casadi.estimation.gauss_newton import minimise_in_box
from pneumo_casadi.parameters import FloatArray

#: Below this share of its influence the direction of an effect is lost in rounding; at laboratory
#: noise little is enough.
ROUNDING = 1e-6


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
