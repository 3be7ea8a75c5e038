"""Fit parameters to the balances along smoothed motions: a bounded, weighted least squares.

It needs milliseconds where output error needs seconds, cannot run away from the data, and sees
each balance on its own. Its price: noise and filters bias it by a fraction of a per cent.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.residuals import balance_residuals, linearise_residuals
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion
from pneumo_casadi.estimation.output_error.shooting.map_anchor import Anchor
from pneumo_casadi.estimation.output_error.solvers.bounded_step import bounded_minimum
from pneumo_casadi.parameters import FloatArray

MAX_ITERATIONS = 30
#: A step that promises less than this of the cost, for each row, ends the iteration.
TOLERANCE = 1e-5
#: A step is damped tenfold more so often at most, until it keeps this share of what it promises.
DAMPED, KEPT = 12, 1e-3
#: From this iteration on a good step is doubled while that keeps gaining, so often at most: along a
#: bent valley, and where derivatives leave out the effects' states, steps are all alike and short.
DOUBLED_FROM, DOUBLED = 3, 6


@dataclass(frozen=True, eq=False)
class BalanceFit:
    """Parameters fitted to the balances.

    Parameters
    ----------
    theta : (n,) array
        All parameters.
    covariance : (n_free, n_free) array
        Of the model's free parameters, residuals taken for white.
    cost : float
        Σ n_e log σ_e over the balances, with half the squares of the flow map's residuals.
    residuals : tuple of (ne, m) array
        Of every record, rows that do not count included.
    converged : bool
        Whether the last step promised nothing more.
    """

    theta: FloatArray
    covariance: FloatArray
    cost: float
    residuals: tuple[FloatArray, ...]
    converged: bool


@dataclass(frozen=True, eq=False)
class _Problem:
    """The cost of parameters, and its linearisation."""

    model: BalanceFunctions
    data: Sequence[SmoothedMotion]
    anchor: Anchor | None
    sigma_least: FloatArray
    whole: bool

    @cached_property
    def free(self) -> list[int]:
        return [self.model.axis.parameters.index(name) for name in self.model.free]

    @cached_property
    def scales(self) -> FloatArray:
        return self.model.axis.parameters.scales[self.free]

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        parameters = self.model.axis.parameters
        return parameters.lower[self.free], parameters.upper[self.free]

    @cached_property
    def weights(self) -> FloatArray:
        return np.hstack([one.used(self.model.axis) for one in self.data]).astype(float)

    @cached_property
    def n_rows(self) -> FloatArray:
        return np.asarray(self.weights.sum(axis=1))

    def residuals(self, theta: FloatArray) -> tuple[FloatArray, ...]:
        return tuple(balance_residuals(self.model, one, theta) for one in self.data)

    def pull(self, theta: FloatArray) -> FloatArray:
        if self.anchor is None:
            return np.zeros(0)
        return self.anchor(self.anchor.coefficients(self.model.axis.parameters, theta))

    def cost(self, r: Sequence[FloatArray], theta: FloatArray) -> float:
        squares = float(np.sum(self.pull(theta) ** 2))
        return float(np.sum(self.n_rows * np.log(self.sigma(r)))) + 0.5 * squares

    def cost_at(self, theta: FloatArray) -> float:
        return self.cost(self.residuals(theta), theta)

    def sigma(self, r: Sequence[FloatArray]) -> FloatArray:
        squares = np.sum((np.hstack(r) * self.weights) ** 2, axis=1)
        return np.asarray(np.sqrt(squares / self.n_rows + self.sigma_least**2))

    def linearised(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """Return derivatives by the scaled free parameters, weighted residuals, and the cost."""
        parts = [linearise_residuals(self.model, one, theta, self.whole) for one in self.data]
        r = [part.r for part in parts]
        weights = self.weights / self.sigma(r)[:, None]
        e = (np.hstack(r) * weights).ravel()
        A = (np.hstack([part.J for part in parts]) * weights[:, :, None]).reshape(e.size, -1)
        if self.anchor is not None:
            c = self.anchor.coefficients(self.model.axis.parameters, theta)
            A = np.vstack([A, self.anchor.rows(c, self.model.free)])
            e = np.concatenate([e, self.pull(theta)])
        return A * self.scales, e, self.cost(r, theta)

    def stepped(self, theta: FloatArray, step: FloatArray) -> FloatArray:
        """Return parameters after a scaled step, within their bounds against rounding."""
        found = theta.copy()
        found[self.free] = np.clip(theta[self.free] + step * self.scales, *self.bounds)
        return found


def fit_balances(
    model: BalanceFunctions,
    data: Sequence[SmoothedMotion],
    anchor: Anchor | None,
    theta: FloatArray,
    sigma_least: FloatArray,
    whole: bool = False,
) -> BalanceFit:
    """Minimise the balances' residuals over the free parameters within their bounds.

    Parameters
    ----------
    theta : (n,) array
        Start.
    sigma_least : (ne,) array
        What the sensors' noise alone leaves in each balance.
    whole : bool
        Whether derivatives tell all that the effects' states make of the nominal parameters, see
        `linearise_residuals`: without, a fit may end short of the minimum.
    """
    problem = _Problem(model, data, anchor, sigma_least, whole)
    damping, converged = 1e-6, False
    H = np.eye(len(problem.free))
    for iteration in range(1, MAX_ITERATIONS + 1):
        A, e, cost = problem.linearised(theta)
        H, g = A.T @ A, -A.T @ e
        lower, upper = ((b - theta[problem.free]) / problem.scales for b in problem.bounds)
        better = None
        for _ in range(DAMPED):
            step = bounded_minimum(_damped(H, damping), g, lower, upper)
            promised = 0.5 * float(e @ e - np.sum((e + A @ step) ** 2))
            if promised < TOLERANCE * problem.n_rows.sum():
                converged = True
                break
            times = DOUBLED if iteration >= DOUBLED_FROM else 0
            better = _along(problem, theta, step, cost - KEPT * promised, KEPT * promised, times)
            if better is not None:
                damping = max(damping / 10, 1e-9)
                break
            damping = max(damping * 10, 1e-6)
        if better is None:
            break
        theta = better
    left = problem.residuals(theta)
    covariance = np.linalg.pinv(H, hermitian=True) * np.outer(problem.scales, problem.scales)
    return BalanceFit(theta, covariance, problem.cost(left, theta), left, converged)


def _along(
    problem: _Problem, theta: FloatArray, step: FloatArray, cost: float, gain: float, times: int
) -> FloatArray | None:
    """Return the end of a step that was doubled while each time gained; None above a cost."""
    best, least = None, cost
    for power in range(1 + times):
        trial = problem.stepped(theta, 2**power * step)
        found = problem.cost_at(trial)
        if not found < least:  # nor where it is no number
            break
        best, least = trial, found - gain
    return best


def _damped(H: FloatArray, damping: float) -> FloatArray:
    diagonal = np.diag(H)
    return H + damping * np.diag(np.maximum(diagonal, 1e-12 * diagonal.max()))
