"""Damped Gauss-Newton steps on closed nodes: every iterate is a simulation, no cost ever rises."""

from collections.abc import Sequence

import numpy as np

from pneumo_casadi.estimation.output_error.shooting.condensing import linearise
from pneumo_casadi.estimation.output_error.shooting.problem import Problem, Unknowns, shoot_segments
from pneumo_casadi.estimation.output_error.solvers.bounded_step import apply_step, condensed_step
from pneumo_casadi.estimation.output_error.solvers.solution import Solution, misfit, residual_sigma
from pneumo_casadi.parameters import FloatArray

#: Damping to begin with, its bounds, and the factors by which it falls and grows.
DAMPING, LEAST, MOST, FALL, GROW = 1e-3, 1e-9, 1e9, 0.2, 5.0
#: Share of the promised decrease from which a step is taken, and from which it is trusted.
ACCEPT, TRUSTED = 1e-3, 0.5
#: So many steps taken that together gain less than this log-likelihood, the next one promising no
#: more, end where sticking makes the cost rough: what is left cannot be told from noise.
PATIENCE, LITTLE = 10, 0.05


def solve_levenberg_marquardt(
    problem: Problem,
    starts: Sequence[Unknowns],
    sigma: FloatArray,
    reweight: bool,
    max_iterations: int,
    tolerance: float,
) -> Solution:
    """Solve by Levenberg-Marquardt steps; see `solve_gauss_newton`.

    Parameters
    ----------
    starts : sequence of Unknowns
        The one whose simulation fits best is taken; only their initial states count.

    Returns
    -------
    Solution
    """
    point, m, cost = min(
        (_closed(problem, start, sigma, reweight) for start in starts), key=lambda one: one[2]
    )
    if not np.isfinite(cost):
        reason = "no simulation of the record stays finite"
        return Solution(point, m, sigma, reason, 0)
    damping, at, costs = DAMPING, None, [cost]
    for iteration in range(1, max_iterations + 1):
        if at is None:
            sigma = residual_sigma(problem, m) if reweight else sigma
            at = linearise(problem, point, sigma)
        step = condensed_step(problem, at, point, sigma, damping)
        if step is None:
            return Solution(point, m, sigma, "the model ran away from the data", iteration)
        # What is promised counts against the misfit: with σ far below the residuals, a
        # decrease of many nominal units may still be nothing that the data could tell.
        unit = misfit(problem, m, sigma) ** 2
        promised = step.gain / unit / max(1, step.theta.size)
        settled = promised <= 0.1 * tolerance and damping <= 100 * DAMPING
        slow = len(costs) > PATIENCE and costs[-1 - PATIENCE] - cost < LITTLE * unit
        stalled = slow and step.gain < LITTLE * unit
        if settled or stalled:
            return Solution(point, m, sigma, "converged", iteration)
        trial = _closed(problem, apply_step(problem, point, step), sigma, reweight)
        share = (cost - trial[2]) / max(step.gain, 1e-300)
        if share > ACCEPT:
            point, m, cost = trial
            at = None
            costs.append(cost)
        if share > TRUSTED:
            damping = max(LEAST, damping * FALL)
        elif share <= ACCEPT:
            damping *= GROW
            if damping > MOST:
                return Solution(point, m, sigma, "no step helps", iteration)
    return Solution(point, m, sigma, "iterations exhausted", max_iterations)


def _closed(
    problem: Problem, point: Unknowns, sigma: FloatArray, reweight: bool
) -> tuple[Unknowns, FloatArray, float]:
    """Simulate from the initial states; return the point, its outputs and what is minimised.

    Where the noise is estimated, that is the likelihood with the best σ at every point,
    ½ Σ_y N log(mean square of e_y) with the flow map's squares: alternating between σ and
    parameters would creep under gross misfit.
    """
    nodes, m = shoot_segments(problem, point.theta, point.x[:, list(problem.firsts)])
    closed = Unknowns(point.theta, nodes)
    with np.errstate(over="ignore", invalid="ignore"):
        if reweight:
            squares = np.mean((problem.y - m) ** 2, axis=1)
            N = m.shape[1]  # what cost and σ count: means of n samples, not samples
            pull = float(np.sum(problem.anchor_residuals(point.theta) ** 2))
            cost = 0.5 * (N * float(np.sum(np.log(squares))) + pull)
        else:
            cost = problem.cost(point.theta, m, sigma)
    finite = np.isfinite(cost) and np.isfinite(nodes).all()
    return closed, m, cost if finite else float("inf")
