"""Multiple shooting by condensed Gauss-Newton steps (Bock 1987).

The nodes need not satisfy the dynamics before the end: a start from measured states converges
where single shooting from the same parameters would diverge. Full steps without damping are another
algorithm than `estimation.gauss_newton`, since the first of them must be allowed to raise the cost.
Where they do not contract, as under gross misfit, the nodes are closed and damped steps follow
(`solve_levenberg_marquardt`).
"""

import numpy as np

from pneumo_casadi.estimation.gauss_newton import Damping
from pneumo_casadi.estimation.output_error.shooting.condensing import Linearised, linearise
from pneumo_casadi.estimation.output_error.shooting.problem import Problem, Unknowns
from pneumo_casadi.estimation.output_error.solvers.condensed_step import apply_step, condensed_step
from pneumo_casadi.estimation.output_error.solvers.levenberg_marquardt import (
    DAMPING,
    NEAR_OPTIMUM,
    solve_levenberg_marquardt,
)
from pneumo_casadi.estimation.output_error.solvers.solution import Solution, misfit, new_sigma
from pneumo_casadi.parameters import FloatArray

#: Full steps must shrink at least by this over two iterations, or damped ones take over.
SHRINK = 0.5
#: Full steps are tried at most this often, and for this share of the iterations: damped ones,
#: where they are needed, need most of them.
FULL_STEPS, FULL_SHARE = 25, 1 / 3
#: The same from a start that is nearly optimal, where a few suffice or none.
NEAR_STEPS = 10
#: Defects of the dynamics, in scaled states, that count as closed.
CLOSED = 1e-6
#: Step, in standard deviations of a parameter, below which the noise may be estimated again.
ROUGHLY = 0.3


def solve_gauss_newton(
    problem: Problem,
    point: Unknowns,
    sigma: FloatArray,
    reweight: bool,
    max_iterations: int = 150,
    tolerance: float = 1e-3,
) -> Solution:
    """Solve an output-error problem by Gauss-Newton steps within bounds and a trust box.

    Full steps are taken as long as they shrink: from measured states the first of them must be
    allowed to raise the cost. Where they stop shrinking or the model runs away, damped steps
    on closed nodes take over, which can only lower it.

    Parameters
    ----------
    point : Unknowns
        Start; its nodes may violate the dynamics. Its θ holds the fixed parameters.
    sigma : (ny,) array
        Noise of one sample of each output.
    reweight : bool
        Near the optimum, estimate σ from the residuals until it has settled (maximum likelihood
        with unknown noise): misfitting trajectories must not overrule the flow map.
    max_iterations : int
        Iterations before giving up.
    tolerance : float
        Step √(δᵀHδ / n) in standard deviations, misfit counted, root mean square over the n
        parameters, at which a point counts as optimal.

    Returns
    -------
    Solution
    """
    most = min(FULL_STEPS, max(1, round(FULL_SHARE * max_iterations)))
    return _full_then_damped(
        problem, point, sigma, reweight, most, max_iterations, tolerance, DAMPING
    )


def solve_near_optimum(
    problem: Problem,
    point: Unknowns,
    sigma: FloatArray,
    reweight: bool,
    max_iterations: int,
    tolerance: float = 4e-2,
) -> Solution:
    """Solve from a simulation that is nearly optimal; see `solve_gauss_newton`.

    Iterations over long data are dear, and their nominal deviations are small beside all that
    biases an estimate: steps of a twenty-fifth of them are the end. Full steps leave the nodes
    open. On closed nodes steps had to be damped: a window of 20 s in which the axis sticks and
    breaks away is anything but linear in its initial state. Where full steps do not contract,
    nearly undamped ones on closed nodes follow.
    """
    most = min(NEAR_STEPS, max_iterations)
    return _full_then_damped(
        problem, point, sigma, reweight, most, max_iterations, tolerance, NEAR_OPTIMUM
    )


def _full_then_damped(
    problem: Problem,
    point: Unknowns,
    sigma: FloatArray,
    reweight: bool,
    full_steps: int,
    max_iterations: int,
    tolerance: float,
    damping: Damping,
) -> Solution:
    """Take at most so many full steps; where they do not end, damped ones on closed nodes."""
    full = _full_steps(problem, point, sigma, reweight, full_steps, tolerance)
    if full.status == "converged":
        return full
    left = max_iterations - full.iterations
    # σ of a point that does not fit says nothing: the stated noise begins again.
    return solve_levenberg_marquardt(
        problem, (full.point, point), sigma, reweight, left, tolerance, damping
    ).after(full.iterations)


def _full_steps(
    problem: Problem,
    point: Unknowns,
    sigma: FloatArray,
    reweight: bool,
    max_iterations: int,
    tolerance: float,
) -> Solution:
    at = linearise(problem, point, sigma)
    if not at.finite:
        reason = "the start leads to numbers that are not finite"
        return Solution(point, at.m, sigma, reason, 0)
    sizes: list[float] = []
    for iteration in range(1, max_iterations + 1):
        step = condensed_step(problem, at, point, sigma)
        if step is None:
            return Solution(point, at.m, sigma, "the model ran away from the data", iteration)
        trial = apply_step(problem, point, step)
        ahead = linearise(problem, trial, sigma)
        if not ahead.finite:
            return Solution(point, at.m, sigma, "the model ran away from the data", iteration)
        point, at = trial, ahead
        sizes.append(step.size)
        # In standard deviations that count the misfit: with σ far below the residuals, a step
        # of many nominal deviations may still change nothing that the data could tell.
        size = step.size / misfit(problem, at.m, sigma) / np.sqrt(max(1, step.theta.size))
        if reweight and size < ROUGHLY:
            new = new_sigma(problem, at.m, sigma)
            if new is not None:
                sigma, sizes = new, []
                continue
        if size <= tolerance and _defect(problem, at) < CLOSED:
            return Solution(point, at.m, sigma, "converged", iteration, at)
        if _stopped_shrinking(sizes):
            return Solution(point, at.m, sigma, "full steps do not contract", iteration)
    return Solution(point, at.m, sigma, "iterations exhausted", max_iterations)


def _defect(problem: Problem, at: Linearised) -> float:
    """Return the largest defect of the dynamics in scaled states."""
    scaled = at.defects / problem.model.state_scales[:, None]
    return float(np.max(np.abs(scaled), initial=0.0))


def _stopped_shrinking(sizes: list[float]) -> bool:
    """Tell whether full steps no longer contract: the last two against those before."""
    return len(sizes) > 4 and min(sizes[-2:]) > SHRINK * min(sizes[-4:-2])
