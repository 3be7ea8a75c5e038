"""What the data say about the parameters: Gauss-Newton information and covariance."""

import numpy as np

from pneumo_casadi.output_error.gauss_newton import (
    anchor_normal_equations,
    linearise,
    scaled_normal_equations,
)
from pneumo_casadi.output_error.problem import Problem, Unknowns
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.statistics import Estimate, invert_information

#: How near to a bound, in scaled units, a parameter counts as held by it.
AT_BOUND = 1e-6


def information(problem: Problem, point: Unknowns, sigma: FloatArray) -> FloatArray:
    """Return JᵀJ of all weighted residuals in scaled free parameters, shape (n_free, n_free).

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
    for segment in linearise(problem, point).segments:
        full, _ = scaled_normal_equations(problem, segment, sigma)
        inverse = np.linalg.pinv(full[:nx, :nx], rcond=1e-14, hermitian=True)
        total = total + full[nx:, nx:] - full[nx:, :nx] @ inverse @ full[:nx, nx:]
    return total


def estimate(problem: Problem, point: Unknowns, sigma: FloatArray) -> Estimate:
    """Return the covariance of the free parameters at a solution.

    Parameters at a bound are named and left out: their interval is one-sided.
    """
    free = problem.parameters.with_values(point.theta).select(problem.free)
    gap = np.minimum(free.values - free.lower, free.upper - free.values) / free.scales
    at_bound = [name for name, near in zip(free.names, gap < AT_BOUND, strict=True) if near]
    matrix = information(problem, point, sigma)
    return invert_information(matrix, problem.free_scales, free.names, at_bound)
