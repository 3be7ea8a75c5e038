"""Damped Gauss-Newton steps on closed nodes: every iterate is a simulation, no cost ever rises."""

from collections.abc import Sequence

import numpy as np

from pneumo_casadi.output_error.condensing import linearise
from pneumo_casadi.output_error.problem import Problem, Unknowns, shoot
from pneumo_casadi.output_error.solution import Solution, misfit, new_sigma
from pneumo_casadi.output_error.steps import moved, next_step
from pneumo_casadi.parameters import FloatArray

#: Damping to begin with, its bounds, and the factors by which it falls and grows.
DAMPING, LEAST, MOST, FALL, GROW = 1e-3, 1e-9, 1e9, 0.2, 5.0
#: Share of the promised decrease from which a step is taken, and from which it is trusted.
ACCEPT, TRUSTED = 1e-3, 0.5
#: Promised decrease of the likelihood, per parameter, at which the noise is estimated again.
ROUGHLY = 0.05


def damped_steps(
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
    point, m, cost = _best(problem, starts, sigma)
    if not np.isfinite(cost):
        reason = "no simulation of the record stays finite"
        return Solution(point, m, sigma, reason, 0)
    damping, iteration = DAMPING, 0
    at = linearise(problem, point, sigma)
    while iteration < max_iterations:
        iteration += 1
        step = next_step(problem, at, point, sigma, damping)
        if step is None:
            return Solution(point, m, sigma, "the model ran away from the data", iteration)
        scale = misfit(problem, m, sigma) ** 2 * max(1, step.theta.size)
        # What is promised counts against the misfit: with σ far below the residuals, a
        # decrease of many nominal units may still be nothing that the data could tell.
        promised = step.gain / scale
        if reweight and promised < ROUGHLY:
            new = new_sigma(problem, m, sigma)
            if new is not None:
                sigma, damping = new, DAMPING
                cost = problem.cost(point.theta, m, sigma)
                continue
        if promised <= 0.1 * tolerance and damping <= 100 * DAMPING:
            return Solution(point, m, sigma, "converged", iteration)
        trial, trial_m, new_cost = _closed(problem, moved(problem, point, step), sigma)
        share = (cost - new_cost) / max(step.gain, 1e-300)
        if share > ACCEPT:
            point, m, cost = trial, trial_m, new_cost
            at = linearise(problem, point, sigma)
        if share > TRUSTED:
            damping = max(LEAST, damping * FALL)
        elif share <= ACCEPT:
            damping *= GROW
            if damping > MOST:
                return Solution(point, m, sigma, "no step helps", iteration)
    return Solution(point, m, sigma, "iterations exhausted", max_iterations)


def _best(
    problem: Problem, starts: Sequence[Unknowns], sigma: FloatArray
) -> tuple[Unknowns, FloatArray, float]:
    found = [_closed(problem, start, sigma) for start in starts]
    return min(found, key=lambda one: one[2])


def _closed(
    problem: Problem, point: Unknowns, sigma: FloatArray
) -> tuple[Unknowns, FloatArray, float]:
    """Simulate from the initial states; return the point, its outputs and its cost."""
    nodes, m = shoot(problem, point.theta, point.x[:, list(problem.firsts)])
    closed = Unknowns(point.theta, nodes)
    with np.errstate(over="ignore", invalid="ignore"):
        cost = problem.cost(point.theta, m, sigma)
    finite = np.isfinite(cost) and np.isfinite(nodes).all()
    return closed, m, cost if finite else float("inf")
