"""Gauss-Newton information on the parameters and their covariance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.data import Recording
from pneumo_casadi.estimation.flow_anchor import Anchor
from pneumo_casadi.estimation.output_error.flow_scale_shift import flow_scale_shift
from pneumo_casadi.estimation.output_error.shooting.condensing import (
    Linearised,
    anchor_normal_equations,
    block_scores,
    condense,
    eliminate,
    linearise,
)
from pneumo_casadi.estimation.output_error.shooting.problem import Problem, Unknowns
from pneumo_casadi.estimation.output_error.solvers.condensed_step import condensed_step
from pneumo_casadi.estimation.output_error.solvers.solution import Solution
from pneumo_casadi.estimation.statistics import ParameterUncertainty, invert_information
from pneumo_casadi.parameters import FloatArray, Parameters

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
    scores : tuple of tuples of (K, n_free) array
        Jᵀr block by block, one array a record, and, as another kind, point by point of the flow
        map: what its form cannot follow is correlated from point to point as well.
    prior : (n_free, n_free) array or None
        The part of `matrix` that is prior knowledge, which has no scores.
    """

    matrix: FloatArray
    scores: tuple[tuple[FloatArray, ...], ...]
    prior: FloatArray | None = None


def gauss_newton_information(
    problem: Problem, point: Unknowns, sigma: FloatArray, linear: Linearised | None = None
) -> Information:
    """Return the information at a point of the problem.

    Parameters
    ----------
    sigma : (ny,) array
        Standard deviation of one sample of each output.
    linear : Linearised, optional
        The problem linearised there with this noise; by default it is linearised anew.

    Notes
    -----
    Each segment's initial state is eliminated by a Schur complement, so that its uncertainty
    counts; the flow map enters with the coefficients that are free.
    """
    free_states = problem.model.n_initial
    total, _ = anchor_normal_equations(problem, point.theta)
    before = np.diag(total).copy()
    linear = linearise(problem, point, sigma) if linear is None else linear
    if not linear.finite:  # a trajectory that diverged holds no information
        return Information(0 * total, ((np.zeros((1, len(total))),),))
    rows: dict[int, list[FloatArray]] = {}
    for i, condensed in enumerate(condense(problem, linear, sigma)):
        to_theta, _ = eliminate(condensed.H, condensed.g, free_states)
        coupled = condensed.H[free_states:, :free_states]
        before = before + np.diag(condensed.H)[free_states:]
        total = total + condensed.H[free_states:, free_states:] - coupled @ to_theta
        # Windows of one record follow each other: misfit may last longer than one of them.
        rows_of_segment = block_scores(problem, linear, i, condensed)
        own = rows.setdefault(problem.segments[i].record, [])
        own.append(rows_of_segment[:, free_states:] - rows_of_segment[:, :free_states] @ to_theta)
    # What the initial states have taken away but for rounding is no information.
    left = (np.diag(total) > CANCELLED * before).astype(float)
    kinds = [tuple(_joined(rows.pop(record), left) for record in list(rows))]
    anchor = problem.anchor
    if anchor is None:
        return Information(total * np.outer(left, left), tuple(kinds))
    if anchor.n_points:
        kinds.append((_map_scores(problem, anchor, point.theta) * left,))
    c = anchor.coefficients(problem.parameters, point.theta)
    known = anchor.rows(c, problem.free)[anchor.n_points :] * problem.free_scales * left
    return Information(total * np.outer(left, left), tuple(kinds), known.T @ known)


def _joined(parts: list[FloatArray], factor: FloatArray) -> FloatArray:
    """Return the rows of all parts times a factor; of long data without a copy more than needed."""
    rows = np.concatenate(parts)
    rows *= factor
    return rows


def held_by_bounds(parameters: Parameters) -> tuple[str, ...]:
    """Return the parameters that a bound holds."""
    below, above = parameters.values - parameters.lower, parameters.upper - parameters.values
    near = np.minimum(below, above) / parameters.scales < AT_BOUND
    return tuple(name for name, holds in zip(parameters.names, near, strict=True) if holds)


def estimate_uncertainty(
    problem: Problem, solution: Solution, records: Sequence[Recording]
) -> ParameterUncertainty:
    """Return the covariance of the free parameters at a solution.

    Parameters at a bound are named and left out: their interval is one-sided. The robust
    covariance contains two biases: of the smoothed friction, and of the form of the flow map.
    """
    point, sigma = solution.point, solution.sigma
    free = problem.parameters.with_values(point.theta).select(problem.free)
    at_bound = held_by_bounds(free)
    information = gauss_newton_information(problem, point, sigma, solution.linear)
    scales = problem.free_scales
    return invert_information(
        information.matrix,
        scales,
        free.names,
        at_bound,
        information.scores,
        information.prior,
        (
            _smoothing_shift(problem, point, sigma),
            flow_scale_shift(problem, point.theta, records),
        ),
    )


def _smoothing_shift(problem: Problem, point: Unknowns, sigma: FloatArray) -> FloatArray:
    """Return by how much estimates move with twice the width of the friction, (n_free,) scaled.

    With tanh(ẋ/v_s) for the sign of ẋ the axis creeps where it should stick. The bias that this
    causes is proportional to v_s for small v_s, so doubling v_s moves the estimates by the bias
    that they have. One Gauss-Newton step from the optimum gives the move.
    """
    wider = Unknowns(point.theta.copy(), point.x)
    wider.theta[problem.parameters.index("v_s")] *= 2
    step = condensed_step(problem, linearise(problem, wider, sigma), wider, sigma)
    return np.zeros(len(problem.free)) if step is None else step.theta


def _map_scores(problem: Problem, anchor: Anchor, theta: FloatArray) -> FloatArray:
    """Return Jᵀr of each metered point in scaled free parameters, shape (n, n_free)."""
    c = anchor.coefficients(problem.parameters, theta)
    scores = -anchor.rows(c, problem.free) * anchor(c)[:, None] * problem.free_scales
    return scores[: anchor.n_points]
