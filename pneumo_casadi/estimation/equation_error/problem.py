"""The cost of an equation-error fit, its Gauss-Newton steps and where they end."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.residuals import (
    linearise_residuals,
    residuals_of_variants,
)
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion
from pneumo_casadi.estimation.flow_anchor import Anchor
from pneumo_casadi.estimation.gauss_newton import Damping, minimise_in_box
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.machine_code.lane_code import LANES
from pneumo_casadi.parameters import FloatArray

#: Decrease of the cost per row that ends the iteration, where no other is asked for.
TOLERANCE = 1e-5
DAMPING = Damping(
    start=1e-6,
    accept=1e-3,
    trust=1e-3,
    fall=10.0,
    grow=10.0,
    least=1e-9,
    least_after_rejection=1e-3,  # less hardly changes a step that went wrong
    max_rejections=12,
)
#: From this iteration on an accepted step is doubled while that lowers the cost, at most so many
#: times. In a curved valley, and where the derivatives hold the states of the effects, steps all
#: point the same way and are short.
DOUBLE_FROM, MAX_DOUBLINGS = 3, 6


@dataclass(frozen=True, slots=True)
class Trial:
    """Values of all parameters and the cost there."""

    theta: FloatArray
    cost: float


@dataclass(frozen=True, slots=True)
class Linearised:
    """Weighted residuals e at θ, A = ∂e/∂θ for the scaled free parameters, and H = AᵀA.

    `sigma` are the standard deviations of the balances' residuals, (ne,).
    """

    theta: FloatArray
    sigma: FloatArray
    A: FloatArray
    e: FloatArray
    H: FloatArray
    cost: float


@dataclass(frozen=True, slots=True)
class Step:
    """Step of the scaled free parameters and the decrease of the cost that it predicts."""

    delta: FloatArray
    gain: float


def damped(H: FloatArray, damping: float) -> FloatArray:
    """Return H = AᵀA with a share of its diagonal added."""
    diagonal = np.diag(H)
    return np.asarray(H + damping * np.diag(np.maximum(diagonal, 1e-12 * diagonal.max())))


def prior_rows(axis: Axis) -> FloatArray:
    """Return what effects know of their parameters, (k, nθ); see `Effect.prior_rows`."""
    rows = [
        {f"{effect.name}.{name}": weight for name, weight in row.items()}
        for effect in axis.effects
        for row in effect.prior_rows()
    ]
    P = np.zeros((len(rows), len(axis.parameters)))
    for k, row in enumerate(rows):
        for name, weight in row.items():
            P[k, axis.parameters.index(name)] = weight
    return P


@dataclass(frozen=True, eq=False)
class Problem:
    """The cost of parameters, as `minimise` asks for it."""

    model: BalanceFunctions
    motions: Sequence[SmoothedMotion]
    anchor: Anchor | None
    residual_floor: FloatArray
    state_derivatives: bool
    least_gain: float | None = None

    @cached_property
    def free(self) -> list[int]:
        """Indices of the free parameters."""
        return [self.model.axis.parameters.index(name) for name in self.model.free]

    @cached_property
    def scales(self) -> FloatArray:
        """Scales of the free parameters, (n,)."""
        return self.model.axis.parameters.scales[self.free]

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds of the free parameters, each (n,)."""
        parameters = self.model.axis.parameters
        return parameters.lower[self.free], parameters.upper[self.free]

    @cached_property
    def weights(self) -> FloatArray:
        """1 where a row of a balance counts, else 0, (ne, m) over all motions."""
        used = [motion.used(self.model.axis) for motion in self.motions]
        return np.hstack(used).astype(float)

    @cached_property
    def n_rows(self) -> FloatArray:
        """Number of rows that count of each balance, (ne,)."""
        return np.asarray(self.weights.sum(axis=1))

    def residuals(self, theta: FloatArray) -> tuple[FloatArray, ...]:
        """Return the residuals of the balances along each motion, (ne, m)."""
        return next(self.residuals_of([theta]))

    def costs(self, variants: Sequence[FloatArray]) -> list[float]:
        """Return the cost at some values of all parameters."""
        residuals = self.residuals_of(variants)
        return [self.cost(r, theta) for r, theta in zip(residuals, variants, strict=True)]

    def residuals_of(self, variants: Sequence[FloatArray]) -> Iterator[tuple[FloatArray, ...]]:
        """Yield the residuals by motion at each variant, as many at once as run side by side."""
        for k in range(0, len(variants), LANES):
            some = variants[k : k + LANES]
            by_motion = [residuals_of_variants(self.model, motion, some) for motion in self.motions]
            yield from zip(*by_motion, strict=True)

    def map_residuals(self, theta: FloatArray) -> FloatArray:
        """Return the residuals of the flow map over their standard deviation."""
        if self.anchor is None:
            return np.zeros(0)
        return self.anchor(self.anchor.coefficients(self.model.axis.parameters, theta))

    @cached_property
    def prior(self) -> FloatArray:
        """Rows of what effects know of their parameters, (k, nθ)."""
        return prior_rows(self.model.axis)

    def cost(self, r: Sequence[FloatArray], theta: FloatArray) -> float:
        """Return the negative log-likelihood but for a constant, see `EquationErrorResult`."""
        squares = float(np.sum(self.map_residuals(theta) ** 2) + np.sum((self.prior @ theta) ** 2))
        return float(np.sum(self.n_rows * np.log(self.sigma(r)))) + 0.5 * squares

    def sigma(self, r: Sequence[FloatArray]) -> FloatArray:
        """Return the standard deviation of the residuals of each balance, (ne,)."""
        with np.errstate(over="ignore"):  # a trial may run away: then it costs infinitely much
            squares = np.sum((np.hstack(r) * self.weights) ** 2, axis=1)
        return np.asarray(np.sqrt(squares / self.n_rows + self.residual_floor**2))

    def weighted(self, r: Sequence[FloatArray], theta: FloatArray, sigma: FloatArray) -> FloatArray:
        """Return all residuals over their standard deviations: balances, flow map, priors."""
        balances = (np.hstack(r) * (self.weights / sigma[:, None])).ravel()
        return np.concatenate([balances, self.map_residuals(theta), self.prior @ theta])

    def linearise(self, point: Trial) -> Linearised:
        """Return the weighted residuals and their derivatives at a point."""
        theta = point.theta
        parts = [
            linearise_residuals(self.model, motion, theta, self.state_derivatives)
            for motion in self.motions
        ]
        r = [part.r for part in parts]
        sigma = self.sigma(r)
        J = np.hstack([part.J for part in parts]) * (self.weights / sigma[:, None])[:, :, None]
        A = J.reshape(self.weights.size, -1)
        if self.anchor is not None:
            c = self.anchor.coefficients(self.model.axis.parameters, theta)
            A = np.vstack([A, self.anchor.rows(c, self.model.free)])
        if len(self.prior):
            A = np.vstack([A, self.prior[:, self.free]])
        A, e = A * self.scales, self.weighted(r, theta, sigma)
        return Linearised(theta, sigma, A, e, A.T @ A, self.cost(r, theta))

    def step(self, linear: Linearised, damping: float) -> Step:
        """Return the damped Gauss-Newton step within the bounds."""
        A, e = linear.A, linear.e
        lower, upper = ((b - linear.theta[self.free]) / self.scales for b in self.bounds)
        delta = minimise_in_box(damped(linear.H, damping), -A.T @ e, lower, upper)
        return Step(delta, 0.5 * float(e @ e - np.sum((e + A @ delta) ** 2)))

    def settled(
        self, linear: Linearised, step: Step, damping: float, costs: Sequence[float]
    ) -> bool:
        """Tell whether the step predicts, or the last two kept, next to no decrease of the cost.

        Derivatives that hold the states may promise too much.
        """
        least = self.least_gain or TOLERANCE * float(self.n_rows.sum())
        return step.gain < least or (len(costs) > 2 and costs[-3] - costs[-1] < least)

    def take(self, linear: Linearised, step: Step, iteration: int) -> Trial:
        """Return the trial after a step, doubled in late iterations while that lowers the cost."""
        if iteration < DOUBLE_FROM:
            return self._trials(linear.theta, step.delta)[0]
        least_gain = DAMPING.accept * step.gain
        best, trial = self._trials(linear.theta, step.delta, 2 * step.delta)
        if not best.cost < linear.cost - least_gain:
            return best
        for power in range(1, 1 + MAX_DOUBLINGS):
            if power > 1:
                (trial,) = self._trials(linear.theta, 2**power * step.delta)
            if not trial.cost < best.cost - least_gain:  # nor where it is no number
                break
            best = trial
        return best

    def _trials(self, theta: FloatArray, *deltas: FloatArray) -> list[Trial]:
        """Return the trials after scaled steps, within the bounds against rounding."""
        reached = []
        for delta in deltas:
            ahead = theta.copy()
            ahead[self.free] = np.clip(theta[self.free] + delta * self.scales, *self.bounds)
            reached.append(ahead)
        with np.errstate(over="ignore", invalid="ignore"):  # a trial may run away
            costs = self.costs(reached)
        return [Trial(theta, cost) for theta, cost in zip(reached, costs, strict=True)]
