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
    linearise,
    scaled_normal_equations,
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
    at = linearise(problem, point)
    if not at.finite:
        return Solution(point, sigma, "the start leads to numbers that are not finite", 0)
    sizes: list[float] = []
    penalty, damped = 0.0, False
    for iteration in range(1, max_iterations + 1):
        step = _gauss_newton_step(problem, at, point, sigma)
        sizes.append(step.size)
        damped = damped or _stopped_shrinking(sizes)
        if damped:
            penalty = max(penalty, step.penalty(at.defects / problem.axis.state_scales))
            trial = _searched(problem, at, point, step, sigma, penalty)
        else:
            trial = _finite(problem, point, step)
        if trial is None:
            return Solution(_with_outputs(point, at.m), sigma, "no step helps", iteration)
        found = linearise(problem, trial)
        if not found.finite:
            return Solution(
                _with_outputs(point, at.m), sigma, "the model ran away from the data", iteration
            )
        point, at = trial, found
        closed = float(np.max(np.abs(at.defects) / problem.axis.state_scales))
        # In standard deviations that count the misfit: with σ far below the residuals, a step
        # of many nominal deviations may still change nothing that the data could tell.
        size = step.size / _misfit(problem, at, sigma) / np.sqrt(max(1, step.theta.size))
        if reweight and size < ROUGHLY:
            new = residual_sigma(problem, at.m)
            if np.any(np.abs(new / sigma - 1) > SETTLED):
                sigma, sizes, penalty, damped = new, [], 0.0, False
                continue
        if size <= tolerance and closed < CLOSED:
            return Solution(_with_outputs(point, at.m), sigma, "converged", iteration)
    return Solution(_with_outputs(point, at.m), sigma, "iterations exhausted", max_iterations)


def _misfit(problem: Problem, at: Linearised, sigma: FloatArray) -> float:
    """Return the root mean square of the residuals over σ, at least one."""
    e = (problem.y - at.m) / sigma[:, None]
    return float(np.sqrt(max(1.0, problem.blocks.n * float(np.mean(e**2)))))


def _stopped_shrinking(sizes: list[float]) -> bool:
    """Tell whether full steps no longer contract: the last two against those before."""
    return len(sizes) > 4 and min(sizes[-2:]) > SHRINK * min(sizes[-4:-2])


def _with_outputs(point: Unknowns, m: FloatArray) -> Unknowns:
    return Unknowns(point.theta, point.x, m)


@dataclass(frozen=True, slots=True)
class Step:
    """A Gauss-Newton step of all unknowns, and what it promises.

    Parameters
    ----------
    theta : (n_free,) array
        Step of the scaled free parameters.
    x : (nx, n_nodes) array
        Step of the states.
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
    nx = len(problem.axis.states)
    H, g = anchor_normal_equations(problem, point.theta)
    slope_map = g
    eliminated = []
    for segment in at.segments:
        full, gradient = scaled_normal_equations(problem, segment, sigma)
        inverse = np.linalg.pinv(full[:nx, :nx], rcond=1e-14, hermitian=True)
        G, h = inverse @ full[:nx, nx:], inverse @ gradient[:nx]
        H = H + full[nx:, nx:] - full[nx:, :nx] @ G
        g = g + gradient[nx:] - full[nx:, :nx] @ h
        eliminated.append((G, h))
    theta = _bounded_step(problem, H, g, point)
    scale = np.concatenate([problem.axis.state_scales, problem.free_scales])
    weight = problem.blocks.n / sigma**2
    moves, slope, block = [], -float(slope_map @ theta), 0
    for segment, (G, h) in zip(at.segments, eliminated, strict=True):
        full_step = np.concatenate([h - G @ theta, theta]) * scale
        moves.append((segment.S @ full_step + segment.c).T)
        e = problem.y[:, block : block + len(segment.r)] - at.m[:, block : block + len(segment.r)]
        ahead = (segment.r - segment.J @ full_step).T
        slope += float(np.sum(weight[:, None] * e * (ahead - e)))
        block += len(segment.r)
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
    scale = problem.axis.state_scales

    def merit(candidate: Unknowns, defects: FloatArray) -> float:
        squares = float(np.sum((defects / scale) ** 2))
        return problem.cost(candidate, sigma) + 0.5 * penalty * squares

    before = merit(_with_outputs(point, at.m), at.defects)
    slope = step.slope - penalty * float(np.sum((at.defects / scale) ** 2))
    for halving in range(HALVINGS + 1):
        share = 0.5**halving
        trial, defects = evaluate(problem, _moved(problem, point, step, share))
        promised = 1e-4 * share * min(slope, 0.0)
        if merit(trial, defects) <= before + promised + ROUNDING * abs(before):
            return trial
    return None


def _finite(problem: Problem, point: Unknowns, step: Step) -> Unknowns | None:
    """Take the full step, halved only where the model leaves the finite numbers."""
    for halving in range(HALVINGS + 1):
        trial, defects = evaluate(problem, _moved(problem, point, step, 0.5**halving))
        if np.isfinite(defects).all() and np.isfinite(trial.m).all():
            return trial
    return None


def evaluate(problem: Problem, point: Unknowns) -> tuple[Unknowns, FloatArray]:
    """Return the point with the model's outputs, and the defects, shape (n_blocks, nx)."""
    ends, m = values(problem, point)
    return _with_outputs(point, m), (ends - point.x[:, problem.starts + 1]).T


def _moved(problem: Problem, point: Unknowns, step: Step, share: float) -> Unknowns:
    mask, parameters = problem.parameters.free_mask, problem.parameters
    theta = point.theta.copy()
    moved = theta[mask] + share * step.theta * problem.free_scales
    theta[mask] = np.clip(moved, parameters.lower[mask], parameters.upper[mask])
    return Unknowns(theta, point.x + share * step.x, point.m)


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
