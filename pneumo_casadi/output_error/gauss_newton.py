"""Multiple shooting by condensed Gauss-Newton steps (Bock 1987).

Nodes need not satisfy the dynamics on the way: a start from measured states survives where single
shooting from the same parameters would drift away.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from pneumo_casadi.output_error.condensing import (
    Linearised,
    anchor_normal_equations,
    condense,
    eliminate,
    linearise,
)
from pneumo_casadi.output_error.problem import Problem, Unknowns, values
from pneumo_casadi.output_error.solution import SETTLED, Solution, residual_sigma
from pneumo_casadi.parameters import FloatArray

#: Largest step of a parameter, in its scales, that the linearisation is trusted for.
TRUST = 0.5
#: Steps are halved at most this often.
HALVINGS = 10
#: Eigenvalues of the information below this share of the largest take no step.
RANK = 1e-13
#: Full steps must shrink at least by this over two iterations, or the line search takes over.
SHRINK = 0.5
#: Defects of the dynamics, in scaled states, that count as closed.
CLOSED = 1e-6
#: Step, in standard deviations of a parameter, below which the noise may be estimated again.
ROUGHLY = 0.3
#: Relative rounding of the cost; less than this is no increase.
ROUNDING = 1e-12


def solve_gauss_newton(
    problem: Problem,
    point: Unknowns,
    sigma: FloatArray,
    reweight: bool,
    max_iterations: int = 50,
    tolerance: float = 1e-3,
) -> Solution:
    """Solve an output-error problem by Gauss-Newton steps within bounds and a trust box.

    Full steps are taken as long as they shrink: from measured states the first of them must be
    allowed to raise the cost. Where they stop shrinking, a line search takes over.

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
        Largest step, in standard deviations of a parameter, at which a point counts as optimal.

    Returns
    -------
    Solution
    """
    at = linearise(problem, point, sigma)
    if not at.finite:
        reason = "the start leads to numbers that are not finite"
        return Solution(point, at.m, sigma, reason, 0)
    sizes: list[float] = []
    penalty, damped, iteration = 0.0, False, 0
    while iteration < max_iterations:
        iteration += 1
        step = _gauss_newton_step(problem, at, point, sigma)
        sizes.append(step.size)
        damped = damped or _stopped_shrinking(sizes)
        if damped:
            penalty = max(penalty, step.penalty(_scaled_defects(problem, at)))
            trial = _searched(problem, at, point, step, sigma, penalty)
            if trial is None:
                return Solution(point, at.m, sigma, "no step helps", iteration)
            found = linearise(problem, trial, sigma)
        else:
            trial, found = _finite(problem, point, step, sigma)
        if not found.finite:
            return Solution(point, at.m, sigma, "the model ran away from the data", iteration)
        point, at = trial, found
        closed = float(np.max(np.abs(_scaled_defects(problem, at)), initial=0.0))
        # In standard deviations that count the misfit: with σ far below the residuals, a step
        # of many nominal deviations may still change nothing that the data could tell.
        size = step.size / _misfit(problem, at, sigma) / np.sqrt(max(1, step.theta.size))
        if reweight and size < ROUGHLY:
            new = residual_sigma(problem, at.m)
            if np.any(np.abs(new / sigma - 1) > SETTLED):
                sigma, sizes, penalty, damped = new, [], 0.0, False
                continue
        if size <= tolerance and closed < CLOSED:
            return Solution(point, at.m, sigma, "converged", iteration)
    return Solution(point, at.m, sigma, "iterations exhausted", iteration)


def _scaled_defects(problem: Problem, at: Linearised) -> FloatArray:
    defects: FloatArray = at.defects / problem.model.state_scales[:, None]
    return defects


def _misfit(problem: Problem, at: Linearised, sigma: FloatArray) -> float:
    """Return the root mean square of the residuals over σ, at least one."""
    e = (problem.y - at.m) / sigma[:, None]
    return float(np.sqrt(max(1.0, problem.n * float(np.mean(e**2)))))


def _stopped_shrinking(sizes: list[float]) -> bool:
    """Tell whether full steps no longer contract: the last two against those before."""
    return len(sizes) > 4 and min(sizes[-2:]) > SHRINK * min(sizes[-4:-2])


@dataclass(frozen=True, slots=True)
class Step:
    """A Gauss-Newton step of all unknowns, and what it promises.

    Parameters
    ----------
    theta : (n_free,) array
        Step of the scaled free parameters.
    x : (nx, I) array
        Step of the states, SI.
    size : float
        Length of the parameter step in standard deviations, √(δᵀHδ).
    slope : float
        Derivative of the cost along the step.
    """

    theta: FloatArray
    x: FloatArray
    size: float
    slope: float

    def penalty(self, defects: FloatArray) -> float:
        """Return the weight of squared defects that makes this step one of descent."""
        D = float(np.sum(defects**2))
        wanted = self.slope + 0.5 * self.size**2
        return 2 * wanted / D if wanted > 0 and D > 1e-24 else 0.0


def _gauss_newton_step(
    problem: Problem, at: Linearised, point: Unknowns, sigma: FloatArray
) -> Step:
    """Eliminate the initial states, solve for the parameters, and go back to all nodes."""
    free_states = len(problem.axis.states)
    H, g = anchor_normal_equations(problem, point.theta)
    slope_map = g
    condensed = condense(problem, at, sigma)
    eliminated = []
    for segment in condensed:
        to_theta, from_gradient = eliminate(segment.H, segment.g, free_states)
        H = (
            H
            + segment.H[free_states:, free_states:]
            - segment.H[free_states:, :free_states] @ (to_theta)
        )
        g = g + segment.g[free_states:] - segment.H[free_states:, :free_states] @ from_gradient
        eliminated.append((to_theta, from_gradient))
    theta = _bounded_step(problem, H, g, point)
    size = problem.model.state_scales
    moves, slope = [], -float(slope_map @ theta)
    for segment, (to_theta, from_gradient) in zip(condensed, eliminated, strict=True):
        nodes = segment.T @ np.concatenate([from_gradient - to_theta @ theta, theta]) + segment.c
        moves.append(nodes.T * size[:, None])
        slope -= float(np.sum(segment.g_k[:, : size.size] * nodes))
        slope -= float(np.sum(segment.g_k[:, size.size :] @ theta))
    return Step(theta, np.hstack(moves), float(np.sqrt(max(0.0, float(theta @ H @ theta)))), slope)


def _searched(
    problem: Problem,
    at: Linearised,
    point: Unknowns,
    step: Step,
    sigma: FloatArray,
    penalty: float,
) -> Unknowns | None:
    """Shorten the step until cost and weighted defects together fall (Armijo's rule)."""
    squares = float(np.sum(_scaled_defects(problem, at) ** 2))
    before = problem.cost(point.theta, at.m, sigma) + 0.5 * penalty * squares
    slope = step.slope - penalty * squares
    for halving in range(HALVINGS + 1):
        share = 0.5**halving
        trial = _moved(problem, point, step, share)
        ends, m = values(problem, trial)
        joins = problem.joined
        defects = (ends[:, joins] - trial.x[:, joins + 1]) / problem.model.state_scales[:, None]
        merit = problem.cost(trial.theta, m, sigma) + 0.5 * penalty * float(np.sum(defects**2))
        if merit <= before + 1e-4 * share * min(slope, 0.0) + ROUNDING * abs(before):
            return trial
    return None


def _finite(
    problem: Problem, point: Unknowns, step: Step, sigma: FloatArray
) -> tuple[Unknowns, Linearised]:
    """Take the full step, halved only where the model leaves the finite numbers."""
    for halving in range(HALVINGS + 1):
        trial = _moved(problem, point, step, 0.5**halving)
        found = linearise(problem, trial, sigma)
        if found.finite:
            break
    return trial, found


def _moved(problem: Problem, point: Unknowns, step: Step, share: float) -> Unknowns:
    mask, parameters = problem.parameters.free_mask, problem.parameters
    theta = point.theta.copy()
    moved = theta[mask] + share * step.theta * problem.free_scales
    theta[mask] = np.clip(moved, parameters.lower[mask], parameters.upper[mask])
    return Unknowns(theta, point.x + share * step.x)


def _bounded_step(problem: Problem, H: FloatArray, g: FloatArray, point: Unknowns) -> FloatArray:
    """Minimise ½ δᵀHδ - gᵀδ within the parameters' bounds and the trust box."""
    if g.size == 0:
        return g
    mask, scale = problem.parameters.free_mask, problem.free_scales
    here = point.theta[mask]
    lower = np.maximum((problem.parameters.lower[mask] - here) / scale, -TRUST)
    upper = np.minimum((problem.parameters.upper[mask] - here) / scale, TRUST)
    diagonal = np.diag(H)
    # What is left of a parameter without information is rounding: it takes no step.
    known = diagonal > RANK**2 * diagonal.max()
    size = np.sqrt(np.where(known, diagonal, 1.0))
    values, vectors = np.linalg.eigh(H * np.outer(known, known) / np.outer(size, size))
    good = values > RANK * values[-1]
    root = np.sqrt(values[good])
    basis = vectors[:, good]
    free_step: FloatArray = basis @ ((basis.T @ (g / size)) / root**2) / size
    if np.all(free_step >= lower) and np.all(free_step <= upper):
        return free_step
    A = (basis * root).T * size
    b = (basis.T @ (g / size)) / root
    # lsq_linear wants a box with an inside; a parameter at its bound gets a hair's breadth.
    hair = 1e-12
    found = lsq_linear(A, b, (np.minimum(lower, -hair), np.maximum(upper, hair)), method="bvls")
    bounded: FloatArray = np.clip(found.x, lower, upper)
    return bounded
