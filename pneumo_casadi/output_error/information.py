"""What the data say about the parameters: Gauss-Newton information and covariance."""

from dataclasses import dataclass

import numpy as np

from pneumo_casadi.output_error.anchor import Anchor
from pneumo_casadi.output_error.condensing import (
    Condensed,
    anchor_normal_equations,
    linearise,
    scaled_normal_equations,
)
from pneumo_casadi.output_error.problem import Problem, Unknowns
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.statistics import Estimate, invert_information

#: How near to a bound, in scaled units, a parameter counts as held by it.
AT_BOUND = 1e-6
#: Information left beside that before the elimination of the states, below which it is rounding.
CANCELLED = 1e-12


@dataclass(frozen=True, slots=True)
class Information:
    """Gauss-Newton information on the scaled free parameters, initial states eliminated.

    Parameters
    ----------
    matrix : (n_free, n_free) array
        JᵀJ of all weighted residuals.
    scores : tuple of (K, n_free) array
        Jᵀr block by block, one array a record, and point by point of the flow map: what its
        form cannot follow is correlated from point to point as well.
    """

    matrix: FloatArray
    scores: tuple[FloatArray, ...]


def information(problem: Problem, point: Unknowns, sigma: FloatArray) -> Information:
    """Return the information at a point of the problem.

    Parameters
    ----------
    sigma : (ny,) array
        Standard deviation of one sample of each output.

    Notes
    -----
    Each segment's initial state is eliminated by a Schur complement, so that its uncertainty
    counts; the flow map enters with the coefficients that are free.
    """
    nx = len(problem.axis.states)
    total, _ = anchor_normal_equations(problem, point.theta)
    before = np.diag(total).copy()
    linear = linearise(problem, point)
    if not linear.finite:  # a trajectory that ran away says nothing
        return Information(0 * total, (np.zeros((1, len(total))),))
    scores: dict[int, list[FloatArray]] = {}
    if problem.anchor is not None:
        scores[-1] = [_map_scores(problem, problem.anchor, point.theta)]
    for segment, condensed in zip(problem.segments, linear.segments, strict=True):
        full, _ = scaled_normal_equations(problem, condensed, sigma)
        inverse = np.linalg.pinv(full[:nx, :nx], rcond=1e-14, hermitian=True)
        eliminated = inverse @ full[:nx, nx:]
        before = before + np.diag(full)[nx:]
        total = total + full[nx:, nx:] - full[nx:, :nx] @ eliminated
        # Windows of one record follow each other: misfit may last longer than one of them.
        own = scores.setdefault(segment.record, [])
        own.append(_scores(problem, condensed, sigma, eliminated))
    # What the initial states have taken away but for rounding is no information.
    left = (np.diag(total) > CANCELLED * before).astype(float)
    rows = tuple(np.concatenate(parts) * left for parts in scores.values())
    return Information(total * np.outer(left, left), rows)


def estimate(problem: Problem, point: Unknowns, sigma: FloatArray) -> Estimate:
    """Return the covariance of the free parameters at a solution.

    Parameters at a bound are named and left out: their interval is one-sided.
    """
    free = problem.parameters.with_values(point.theta).select(problem.free)
    gap = np.minimum(free.values - free.lower, free.upper - free.values) / free.scales
    at_bound = [name for name, near in zip(free.names, gap < AT_BOUND, strict=True) if near]
    found = information(problem, point, sigma)
    scales = problem.free_scales
    return invert_information(found.matrix, scales, free.names, at_bound, found.scores)


def _map_scores(problem: Problem, anchor: Anchor, theta: FloatArray) -> FloatArray:
    """Return Jᵀr of each metered point in scaled free parameters, shape (n, n_free)."""
    c = theta[[problem.parameters.index(name) for name in anchor.names]]
    weighted = -anchor.jacobian(c) * anchor(c)[:, None]
    found = np.zeros((anchor.n, len(problem.free)))
    for column, name in enumerate(anchor.names):
        if name in problem.free:
            at = problem.free.index(name)
            found[:, at] = weighted[:, column] * problem.free_scales[at]
    return found


def _scores(
    problem: Problem, segment: Condensed, sigma: FloatArray, eliminated: FloatArray
) -> FloatArray:
    """Return Jᵀr of each block of a segment, initial state eliminated, shape (K, n_free)."""
    nx = len(problem.axis.states)
    weight = problem.blocks.n / sigma**2
    J_x = segment.J[:, :, :nx] * problem.axis.state_scales
    J = segment.J[:, :, nx:] * problem.free_scales - J_x @ eliminated
    found: FloatArray = np.einsum("kyn,ky->kn", J, segment.r * weight)
    return found
