"""Damped Gauss-Newton steps on closed nodes: every iterate is a simulation, no cost ever rises."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneumo_casadi.estimation.gauss_newton import Damping, minimise
from pneumo_casadi.estimation.output_error.shooting.condensing import Linearised, linearise
from pneumo_casadi.estimation.output_error.shooting.problem import (
    Problem,
    Unknowns,
    shoot_segments,
)
from pneumo_casadi.estimation.output_error.solvers.condensed_step import (
    Step,
    apply_step,
    condensed_step,
)
from pneumo_casadi.estimation.output_error.solvers.solution import Solution, misfit, residual_sigma
from pneumo_casadi.parameters import FloatArray

DAMPING = Damping(start=1e-3, accept=1e-3, trust=0.5, fall=5.0, grow=5.0, least=1e-9, most=1e9)
#: From a point that is nearly optimal: the first step is nearly undamped. One that goes wrong, as
#: where a window sticks, is damped at once, and the damping goes as fast: a small λ still slows
#: what the data hardly tell apart.
NEAR_OPTIMUM = replace(DAMPING, start=1e-6, fall=100.0, grow=30.0)
#: A small step counts as converged only where λ is at most this multiple of its start.
MAX_SETTLED_DAMPING = 100.0
#: Where sticking makes the cost rough, the iteration ends once so many accepted steps together
#: have gained less than this log-likelihood, or so many rejections have raised λ, and the next
#: step predicts no more.
STALL_STEPS, STALL_GAIN = 10, 0.05
STALL_DAMPING = DAMPING.start * DAMPING.grow**STALL_STEPS


@dataclass(frozen=True, slots=True)
class _Simulated:
    """A point with closed nodes, its mean outputs and its cost, infinite if not finite."""

    point: Unknowns
    m: FloatArray
    cost: float


@dataclass(frozen=True, slots=True)
class _Linearised:
    """The problem linearised at a simulated point with the noise taken there."""

    simulated: _Simulated
    at: Linearised
    sigma: FloatArray

    @property
    def cost(self) -> float:
        return self.simulated.cost


@dataclass(frozen=True, slots=True)
class _ClosedNodes:
    """The output-error problem on closed nodes, as `minimise` asks for it."""

    problem: Problem
    sigma: FloatArray
    reweight: bool
    tolerance: float

    def linearise(self, point: _Simulated) -> _Linearised:
        sigma = residual_sigma(self.problem, point.m) if self.reweight else self.sigma
        return _Linearised(point, linearise(self.problem, point.point, sigma), sigma)

    def step(self, linear: _Linearised, damping: float) -> Step | None:
        point = linear.simulated.point
        return condensed_step(self.problem, linear.at, point, linear.sigma, damping)

    def settled(
        self, linear: _Linearised, step: Step, damping: float, costs: Sequence[float]
    ) -> bool:
        # The predicted gain is measured against the misfit: with σ far below the residuals, a
        # decrease of many nominal units may still be nothing that the data could tell.
        unit = misfit(self.problem, linear.simulated.m, linear.sigma) ** 2
        predicted = step.gain / unit / max(1, step.theta.size)
        if predicted <= 0.1 * self.tolerance and damping <= MAX_SETTLED_DAMPING * DAMPING.start:
            return True
        before = costs[-1 - STALL_STEPS] if len(costs) > STALL_STEPS else np.inf
        in_vain = len(costs) > 1 and damping >= STALL_DAMPING
        gained_little = before - costs[-1] < STALL_GAIN * unit
        return (gained_little or in_vain) and step.gain < STALL_GAIN * unit

    def take(self, linear: _Linearised, step: Step, iteration: int) -> _Simulated:
        return self.simulate(apply_step(self.problem, linear.simulated.point, step))

    def simulate(self, point: Unknowns) -> _Simulated:
        """Simulate from the initial states.

        Where the noise is estimated, the cost is the likelihood with the best σ at every point,
        ½ Σ_y N log(mean square of e_y) with the flow map's squares: alternating between σ and
        parameters would creep under gross misfit.
        """
        problem = self.problem
        nodes, m = shoot_segments(problem, point.theta, point.x[:, list(problem.firsts)])
        with np.errstate(over="ignore", invalid="ignore"):
            if self.reweight:
                squares = np.mean((problem.y - m) ** 2, axis=1)
                N = m.shape[1]  # cost and σ count means of n samples, not samples
                of_map = float(np.sum(problem.anchor_residuals(point.theta) ** 2))
                cost = 0.5 * (N * float(np.sum(np.log(squares))) + of_map)
            else:
                cost = problem.cost(point.theta, m, self.sigma)
        finite = np.isfinite(cost) and np.isfinite(nodes).all()
        return _Simulated(Unknowns(point.theta, nodes), m, cost if finite else float("inf"))


def solve_levenberg_marquardt(
    problem: Problem,
    starts: Sequence[Unknowns],
    sigma: FloatArray,
    reweight: bool,
    max_iterations: int,
    tolerance: float,
    damping: Damping = DAMPING,
) -> Solution:
    """Solve by damped steps on closed nodes; see `solve_gauss_newton`.

    Parameters
    ----------
    problem : Problem
        What to solve.
    starts : sequence of Unknowns
        The one whose simulation fits best is taken; only their initial states count.
    sigma, reweight, max_iterations, tolerance
        As for `solve_gauss_newton`; rejected steps count as iterations.
    damping : Damping
        Schedule of λ.

    Returns
    -------
    Solution
    """
    closed = _ClosedNodes(problem, sigma, reweight, tolerance)
    start = min((closed.simulate(point) for point in starts), key=lambda trial: trial.cost)
    if not np.isfinite(start.cost):
        reason = "no simulation of the record stays finite"
        return Solution(start.point, start.m, sigma, reason, 0)
    minimum = minimise(closed, start, damping, max_iterations, max_iterations)
    if minimum.linear is not None:
        sigma = minimum.linear.sigma
    point, at = minimum.point, minimum.linear
    linear = at.at if at is not None and at.simulated is point else None
    return Solution(point.point, point.m, sigma, minimum.status.value, minimum.trials, linear)
