"""The linearised problem, condensed to the parameters and one initial state per segment.

The linearised dynamics tie every node to the segment's initial state and the parameters,

    δx_{k+1} = A_k δx_k + B_k δθ + d_k    with the defects d_k = F(x_k, w_k, θ) - x_{k+1},

so one sweep through the intervals, δx_k = T_k (δx_0, δθ) + c_k, leaves a dense least-squares
problem in (δx_0, δθ), of the size of the parameters and not of the record (Bock 1987).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.estimation.output_error.shooting.interval import triangle_index
from pneumo_casadi.estimation.output_error.shooting.problem import (
    Problem,
    Unknowns,
    shoot_in_rounds,
)
from pneumo_casadi.model.machine_code.calls import call_side_by_side
from pneumo_casadi.parameters import FloatArray

#: Sensitivities and residuals beyond this come from a trajectory that ran away.
HUGE = 1e60
#: Intervals whose normal equations are added up at once: what lies between stays in the cache.
AT_ONCE = 32


@dataclass(frozen=True, slots=True)
class Linearised:
    """The problem linearised at a point, interval by interval, in SI units.

    Parameters
    ----------
    ends : (nx, I) array
        States at the ends of the intervals.
    m : (ny, n_blocks) array
        Mean outputs of the model.
    defects : (nx, joins) array
        Ends of intervals less the nodes that follow them.
    S : (I, nx, nx + n_free) array
        ∂end/∂(x_k, θ_free).
    H : (I, ny, m (m + 1) / 2) array
        JᵀJ of the mean outputs, per output, for the m = nx + n_free unknowns of an interval: its
        lower triangle, column by column.
    g : (I, ny, nx + n_free) array
        Jᵀe, per output.
    scores : (n_blocks, nx + n_free) array
        Weighted Jᵀe of every block, to the node and parameters of its interval.
    """

    ends: FloatArray
    m: FloatArray
    defects: FloatArray
    S: FloatArray
    H: FloatArray
    g: FloatArray
    scores: FloatArray

    @property
    def finite(self) -> bool:
        """Whether the model stayed within numbers whose squares are finite."""
        parts = (self.ends, self.m, self.S, self.H, self.g)
        # By the extremes: the arrays of a long record are hundreds of megabytes.
        return all(part.min() > -HUGE and part.max() < HUGE for part in parts if part.size)


@dataclass(frozen=True, slots=True)
class Condensed:
    """One segment, condensed to its initial state and the parameters, both scaled.

    Parameters
    ----------
    H : (n, n) array
        JᵀJ of the weighted residuals of the segment in (δx_0, δθ_free).
    g : (n,) array
        Jᵀr, the residuals taken at (δx_0, δθ) = 0 with the defects closed.
    T : (intervals, nx, n) array
        ∂x_k/∂(x_0, θ_free), scaled on both sides.
    c : (intervals, nx) array
        Part of δx_k, scaled, that closes the defects.
    closing : float
        What closing the defects adds to the sum of squares, to first order.
    """

    H: FloatArray
    g: FloatArray
    T: FloatArray
    c: FloatArray
    closing: float


def linearise(problem: Problem, point: Unknowns, sigma: FloatArray) -> Linearised:
    """Linearise the problem at a point; `sigma` (ny,) weighs the scores alone."""
    data = problem.data
    return _gathered(problem, point.x, _swept(problem, point, data.w, data.h, data.y, sigma))


def shoot_and_linearise(
    problem: Problem, theta: FloatArray, x_0: FloatArray, sigma: FloatArray
) -> Linearised:
    """Linearise on closed nodes, found along the way; see `linearise` and `shoot_segments`."""
    data = problem.data

    def run(at: NDArray[np.intp], x: FloatArray) -> tuple[FloatArray, ...]:
        w, h, y = (problem.of_intervals(at, part) for part in (data.w, data.h, data.y))
        return _swept(problem, Unknowns(theta, x), w, h, y, sigma)

    return _gathered(problem, *shoot_in_rounds(problem, x_0, run))


def _swept(
    problem: Problem,
    point: Unknowns,
    w: FloatArray,
    h: FloatArray,
    y: FloatArray,
    sigma: FloatArray,
) -> tuple[FloatArray, ...]:
    """Return what the sensitivity function makes of some intervals, side by side."""
    count = point.x.shape[1]
    theta = np.tile(point.theta[:, None], count)
    weight = np.tile((problem.n / sigma**2)[:, None], count)
    given = point.x, w, theta, h, y, weight
    return call_side_by_side(problem.functions.sensitivity, *given, memory=problem.memory)


def _gathered(problem: Problem, x: FloatArray, swept: tuple[FloatArray, ...]) -> Linearised:
    """Return the linearised problem, from the sensitivity function at all nodes x (nx, I)."""
    intervals, nx, ny = problem.I, problem.model.nx, len(problem.axis.outputs)
    m = nx + len(problem.free)
    ends, means, S, H, g, scores = swept
    joins = problem.joined
    return Linearised(
        ends,
        problem.data.without_padding(means),
        ends[:, joins] - x[:, joins + 1],
        S.reshape(nx, intervals, m).transpose(1, 0, 2),
        H.reshape(len(H), intervals, ny).transpose(1, 2, 0),
        g.reshape(m, intervals, ny).transpose(1, 2, 0),
        problem.data.without_padding(scores).T,
    )


def condense(problem: Problem, at: Linearised, sigma: FloatArray) -> tuple[Condensed, ...]:
    """Condense every segment with the noise `sigma` (ny,) of one sample of each output."""
    scale = np.concatenate([problem.model.state_scales, problem.free_scales])
    size = problem.model.state_scales
    d = np.zeros((problem.I, size.size))
    d[problem.joined] = (at.defects / size[:, None]).T
    condensed = []
    with np.errstate(all="ignore"):  # a diverging trial step is found and halved
        for first, segment in zip(problem.firsts, problem.segments, strict=True):
            span = slice(first, first + segment.intervals)
            S = at.S[span] * scale / size[:, None]
            T, c = _swept_through(S, d[span], problem.model.n_initial)
            H_y, g_y = at.H[span], at.g[span]
            condensed.append(_added_up(H_y, g_y, T, c, problem.n / sigma**2, scale))
    return tuple(condensed)


def _swept_through(S: FloatArray, d: FloatArray, free_states: int) -> tuple[FloatArray, FloatArray]:
    """Return T and c of a segment, whose first `free_states` states are free; see `Condensed`."""
    count, nx, m = S.shape
    n = m - nx + free_states
    # T and c side by side, c as the last column.
    swept, added = np.zeros((2, count, nx, n + 1))
    swept[0, :free_states, :free_states] = np.eye(free_states)
    added[:, :, free_states:n], added[:, :, n] = S[:, :, nx:], d
    to_node = np.ascontiguousarray(S[:, :, :nx])
    for k in range(count - 1):
        np.matmul(to_node[k], swept[k], out=swept[k + 1])
        swept[k + 1] += added[k]
    return swept[:, :, :n], swept[:, :, n]


def _added_up(
    H_y: FloatArray,
    g_y: FloatArray,
    T: FloatArray,
    c: FloatArray,
    weight: FloatArray,
    scale: FloatArray,
) -> Condensed:
    """Add up the normal equations of a segment's intervals, per output, with their weights."""
    count, nx, n = T.shape
    m = scale.size
    free_states = n - (m - nx)
    whole = triangle_index(m)
    H, g, closing = np.zeros((n, n)), np.zeros(n), 0.0
    for first in range(0, count, AT_ONCE):
        span = slice(first, first + AT_ONCE)
        H_k = (weight @ H_y[span])[:, whole] * np.outer(scale, scale)
        g_k = weight @ g_y[span] * scale
        # An interval's unknowns are its node, T (δx_0, δθ) + c, and δθ itself.
        to_node, at_c = T[span], c[span]
        A = H_k[:, :, :nx] @ to_node
        A[:, :, free_states:] += H_k[:, :, nx:]
        H += np.tensordot(to_node, A[:, :nx], ((0, 1), (0, 1)))
        H[free_states:] += A[:, nx:].sum(axis=0)
        by_c = (H_k[:, :, :nx] @ at_c[:, :, None])[:, :, 0]
        left = g_k - by_c
        g += np.tensordot(to_node, left[:, :nx], ((0, 1), (0, 1)))
        g[free_states:] += left[:, nx:].sum(axis=0)
        closing += float(np.sum(at_c * (by_c - 2 * g_k)[:, :nx]))
    return Condensed(H, g, T, c, closing)


def eliminate(H: FloatArray, g: FloatArray, first: int) -> tuple[FloatArray, FloatArray]:
    """Solve for the first unknowns of normal equations: they are ``h - G rest``; return G, h."""
    inverse = np.linalg.pinv(H[:first, :first], rcond=1e-14, hermitian=True)
    return inverse @ H[:first, first:], inverse @ g[:first]


def block_scores(
    problem: Problem, at: Linearised, segment: int, condensed: Condensed
) -> FloatArray:
    """Return Jᵀe of every block of a segment in scaled (x_0, θ_free), shape (K, n).

    The defects must be closed: scores are those of a simulation.
    """
    nx = problem.model.nx
    scale = np.concatenate([problem.model.state_scales, problem.free_scales])
    before = sum(s.K for s in problem.segments[:segment])
    cut = problem.segments[segment]
    own = at.scores[before : before + cut.K] * scale
    node = np.arange(cut.K) // cut.per
    scores = np.einsum("kx,kxn->kn", own[:, :nx], condensed.T[node])
    scores[:, scores.shape[1] - len(problem.free) :] += own[:, nx:]
    return np.asarray(scores)


def anchor_normal_equations(problem: Problem, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return JᵀJ and Jᵀr of the flow map in scaled free parameters; zeros without an anchor."""
    free = problem.free
    if problem.anchor is None:
        return np.zeros((len(free), len(free))), np.zeros(len(free))
    c = problem.anchor.coefficients(problem.parameters, theta)
    J = problem.anchor.rows(c, free) * problem.free_scales
    return J.T @ J, -J.T @ problem.anchor(c)
