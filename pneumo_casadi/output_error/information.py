"""What the data say about the parameters: Gauss-Newton information and covariance."""

from dataclasses import dataclass

import numpy as np

from pneumo_casadi.output_error.condensing import (
    Condensed,
    anchor_normal_equations,
    linearise,
    scaled_normal_equations,
)
from pneumo_casadi.output_error.problem import Problem, Unknowns
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.statistics import Estimate, autocorrelation, invert_information

#: How near to a bound, in scaled units, a parameter counts as held by it.
AT_BOUND = 1e-6
#: Information left beside that before the elimination of the states, below which it is rounding.
CANCELLED = 1e-12
#: Residuals further apart than the lag at which their autocorrelation has fallen to this are
#: taken for independent.
UNCORRELATED = 0.1
#: At least so many batches of residuals are compared.
BATCHES = 20


@dataclass(frozen=True, slots=True)
class Information:
    """Gauss-Newton information on the scaled free parameters, initial states eliminated.

    Parameters
    ----------
    matrix : (n_free, n_free) array
        JᵀJ of all weighted residuals.
    scatter : (n_free, n_free) array
        Sum of outer products of the gradient over batches of residuals long enough to be
        independent; equal to `matrix` on average where residuals are white with σ as stated.
    """

    matrix: FloatArray
    scatter: FloatArray


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
    scatter, before = total.copy(), np.diag(total).copy()
    length = _correlation_length(problem, point)
    linear = linearise(problem, point)
    if not linear.finite:  # a trajectory that ran away says nothing
        return Information(np.zeros_like(total), np.zeros_like(total))
    for segment in linear.segments:
        full, _ = scaled_normal_equations(problem, segment, sigma)
        inverse = np.linalg.pinv(full[:nx, :nx], rcond=1e-14, hermitian=True)
        eliminated = inverse @ full[:nx, nx:]
        before = before + np.diag(full)[nx:]
        total = total + full[nx:, nx:] - full[nx:, :nx] @ eliminated
        scatter = scatter + _scatter(problem, segment, sigma, eliminated, length)
    # What the initial states have taken away but for rounding is no information.
    left = np.diag(total) > CANCELLED * before
    return Information(total * np.outer(left, left), scatter * np.outer(left, left))


def estimate(problem: Problem, point: Unknowns, sigma: FloatArray) -> Estimate:
    """Return the covariance of the free parameters at a solution.

    Parameters at a bound are named and left out: their interval is one-sided.
    """
    free = problem.parameters.with_values(point.theta).select(problem.free)
    gap = np.minimum(free.values - free.lower, free.upper - free.values) / free.scales
    at_bound = [name for name, near in zip(free.names, gap < AT_BOUND, strict=True) if near]
    found = information(problem, point, sigma)
    scales = problem.free_scales
    return invert_information(found.matrix, scales, free.names, at_bound, found.scatter)


def _correlation_length(problem: Problem, point: Unknowns) -> int:
    """Return the number of blocks over which residuals are correlated, at least one."""
    e = problem.residuals(point)
    longest = int(max(2, min(e.shape[1] // BATCHES, max(s.K for s in problem.segments))))
    rows = [autocorrelation(row, longest) for row in e if np.ptp(row) > 0]
    below = [int(np.argmax(np.append(np.abs(rho), 0.0) < UNCORRELATED)) for rho in rows]
    # Batch means need batches several times as long as the correlation.
    return max(1, min(longest, 5 * max(below, default=1) - 4))


def _scatter(
    problem: Problem, segment: Condensed, sigma: FloatArray, eliminated: FloatArray, length: int
) -> FloatArray:
    """Sum outer products of the gradient over batches of one segment."""
    nx = len(problem.axis.states)
    weight = problem.blocks.n / sigma**2
    J_x = segment.J[:, :, :nx] * problem.axis.state_scales
    J = segment.J[:, :, nx:] * problem.free_scales - J_x @ eliminated
    scores = np.einsum("kyn,ky->kn", J, segment.r * weight)
    batches = np.add.reduceat(scores, np.arange(0, len(scores), length), axis=0)
    found: FloatArray = batches.T @ batches
    return found
