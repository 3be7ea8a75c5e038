"""One Gauss-Newton step of the condensed problem, within bounds and a trust box."""

from dataclasses import dataclass

import numpy as np

from pneumo_casadi.estimation.gauss_newton import minimise_in_box
from pneumo_casadi.estimation.output_error.shooting.condensing import (
    Linearised,
    anchor_normal_equations,
    condense,
    eliminate,
)
from pneumo_casadi.estimation.output_error.shooting.problem import Problem, Unknowns
from pneumo_casadi.parameters import FloatArray

#: Half the width of the trust box: the largest step of a parameter, in units of its scale.
TRUST = 0.5


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
        Decrease of the cost that the linearised problem predicts, defects closed.
    """

    theta: FloatArray
    x: FloatArray
    size: float
    gain: float


def condensed_step(
    problem: Problem, at: Linearised, point: Unknowns, sigma: FloatArray, damping: float = 0.0
) -> Step | None:
    """Return the damped step of all unknowns within the bounds of the parameters.

    The initial states are eliminated, the parameters solved for, and the nodes follow from both.

    Parameters
    ----------
    damping : float
        Share of its diagonal by which the information is enlarged (Levenberg-Marquardt).

    Returns
    -------
    Step or None
        None where the linearisation is not finite.
    """
    own = problem.model.n_initial
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
    theta = _bounded_parameter_step(problem, H, g, point)
    node_steps = []
    gain = float(g_map @ theta - 0.5 * theta @ H_map @ theta)
    for segment, (to_theta, from_gradient) in zip(condensed, eliminated, strict=True):
        whole = np.concatenate([from_gradient - to_theta @ theta, theta])
        gain += float(segment.g @ whole - 0.5 * whole @ segment.H @ whole)
        nodes = segment.T @ whole + segment.c
        node_steps.append(nodes.T * problem.model.state_scales[:, None])
    size = float(np.sqrt(max(0.0, float(theta @ H @ theta))))
    return Step(theta, np.hstack(node_steps), size, gain)


def apply_step(problem: Problem, point: Unknowns, step: Step, share: float = 1.0) -> Unknowns:
    """Return the point after a share of a step, parameters kept within their bounds."""
    mask, parameters = problem.parameters.free_mask, problem.parameters
    theta = point.theta.copy()
    ahead = theta[mask] + share * step.theta * problem.free_scales
    theta[mask] = np.clip(ahead, parameters.lower[mask], parameters.upper[mask])
    return Unknowns(theta, point.x + share * step.x)


def _bounded_parameter_step(
    problem: Problem, H: FloatArray, g: FloatArray, point: Unknowns
) -> FloatArray:
    """Return the step of the free parameters within their bounds and the trust box."""
    mask, scale = problem.parameters.free_mask, problem.free_scales
    here = point.theta[mask]
    lower = np.maximum((problem.parameters.lower[mask] - here) / scale, -TRUST)
    upper = np.minimum((problem.parameters.upper[mask] - here) / scale, TRUST)
    return minimise_in_box(H, g, lower, upper)
