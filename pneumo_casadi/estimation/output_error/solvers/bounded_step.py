"""One step of the condensed problem: how far, in which direction, and what it promises."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from pneumo_casadi.estimation.output_error.shooting.condensing import (
    Linearised,
    anchor_normal_equations,
    condense,
    eliminate,
)
from pneumo_casadi.estimation.output_error.shooting.problem import Problem, Unknowns
from pneumo_casadi.parameters import FloatArray

#: Largest step of a parameter, in its scales, that the linearisation is trusted for.
TRUST = 0.5
#: Eigenvalues of the information below this share of the largest take no step.
RANK = 1e-13


@dataclass(frozen=True, slots=True)
class Step:
    """A step of all unknowns.

    Parameters
    ----------
    theta : (n_free,) array
        Step of the scaled free parameters.
    x : (nx, I) array
        Step of the states, SI.
    size : float
        Length of the parameter step in standard deviations, √(δᵀHδ).
    gain : float
        Decrease of the cost that the linearised problem promises, defects closed.
    """

    theta: FloatArray
    x: FloatArray
    size: float
    gain: float


def condensed_step(
    problem: Problem, at: Linearised, point: Unknowns, sigma: FloatArray, damping: float = 0.0
) -> Step | None:
    """Eliminate the initial states, solve for the parameters, and go back to all nodes.

    Parameters
    ----------
    damping : float
        Share of its diagonal by which the information is enlarged (Levenberg-Marquardt).

    Returns
    -------
    Step or None
        None where the linearisation is not finite.
    """
    own = len(problem.axis.states)
    H_map, g_map = anchor_normal_equations(problem, point.theta)
    condensed = condense(problem, at, sigma)
    if not all(np.isfinite(s.H).all() and np.isfinite(s.g).all() for s in condensed):
        return None
    H = H_map + damping * np.diag(np.diag(H_map))
    g, eliminated = g_map, []
    for segment in condensed:
        enlarged = segment.H + damping * np.diag(np.diag(segment.H))
        to_theta, from_gradient = eliminate(enlarged, segment.g, own)
        coupled = enlarged[own:, :own]
        H = H + enlarged[own:, own:] - coupled @ to_theta
        g = g + segment.g[own:] - coupled @ from_gradient
        eliminated.append((to_theta, from_gradient))
    theta = bounded_step(problem, H, g, point)
    moves = []
    gain = float(g_map @ theta - 0.5 * theta @ H_map @ theta)
    for segment, (to_theta, from_gradient) in zip(condensed, eliminated, strict=True):
        whole = np.concatenate([from_gradient - to_theta @ theta, theta])
        gain += float(segment.g @ whole - 0.5 * whole @ segment.H @ whole)
        nodes = segment.T @ whole + segment.c
        moves.append(nodes.T * problem.model.state_scales[:, None])
    size = float(np.sqrt(max(0.0, float(theta @ H @ theta))))
    return Step(theta, np.hstack(moves), size, gain)


def apply_step(problem: Problem, point: Unknowns, step: Step, share: float = 1.0) -> Unknowns:
    """Return the point a share of a step further, parameters kept within their bounds."""
    mask, parameters = problem.parameters.free_mask, problem.parameters
    theta = point.theta.copy()
    ahead = theta[mask] + share * step.theta * problem.free_scales
    theta[mask] = np.clip(ahead, parameters.lower[mask], parameters.upper[mask])
    return Unknowns(theta, point.x + share * step.x)


def bounded_step(problem: Problem, H: FloatArray, g: FloatArray, point: Unknowns) -> FloatArray:
    """Minimise ½ δᵀHδ - gᵀδ within the parameters' bounds and the trust box."""
    mask, scale = problem.parameters.free_mask, problem.free_scales
    here = point.theta[mask]
    lower = np.maximum((problem.parameters.lower[mask] - here) / scale, -TRUST)
    upper = np.minimum((problem.parameters.upper[mask] - here) / scale, TRUST)
    return bounded_minimum(H, g, lower, upper)


def bounded_minimum(
    H: FloatArray, g: FloatArray, lower: FloatArray, upper: FloatArray
) -> FloatArray:
    """Minimise ½ δᵀHδ - gᵀδ within a box; what H knows nothing of takes no step."""
    if g.size == 0:
        return g
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
