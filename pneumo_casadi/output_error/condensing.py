"""The linearised problem, condensed to the parameters and one initial state per segment.

The linearised dynamics tie every state to the segment's initial state and the parameters,

    δx_{k+1} = A_k δx_k + B_k δθ + d_k    with the defects d_k = F(x_k, w_k, θ) - x_{k+1},

so one sweep through the blocks leaves a dense least-squares problem in (δx_0, δθ), of the size of
the parameters and not of the record.
"""

from dataclasses import dataclass

import numpy as np

from pneumo_casadi.output_error.problem import Problem, Unknowns, sensitivities
from pneumo_casadi.parameters import FloatArray

#: Sensitivities and residuals beyond this come from a trajectory that ran away.
HUGE = 1e60


@dataclass(frozen=True, slots=True)
class Condensed:
    """One segment, linearised and condensed to its initial state and the parameters.

    Parameters
    ----------
    J : (K, ny, nx + n_free) array
        ∂m_k/∂(x_0, θ_free) along the linearised trajectory, in SI units.
    r : (K, ny) array
        Measured minus linearised mean outputs at (δx_0, δθ) = 0, defects taken into account.
    S : (K + 1, nx, nx + n_free) array
        ∂x_k/∂(x_0, θ_free).
    c : (K + 1, nx) array
        Part of δx_k that closes the defects.
    """

    J: FloatArray
    r: FloatArray
    S: FloatArray
    c: FloatArray


@dataclass(frozen=True, slots=True)
class Linearised:
    """All segments condensed, with the model's outputs and defects at the point itself."""

    segments: tuple[Condensed, ...]
    m: FloatArray
    defects: FloatArray

    @property
    def finite(self) -> bool:
        """Whether the model stayed within numbers whose squares are finite."""
        parts = [part for s in self.segments for part in (s.J, s.r, s.S, s.c)]
        return all(bool((np.abs(part) < HUGE).all()) for part in parts)


def linearise(problem: Problem, point: Unknowns) -> Linearised:
    """Linearise the problem at a point and condense every segment."""
    ends, m, dx, dy = sensitivities(problem, point)
    d = (ends - point.x[:, problem.starts + 1]).T
    e = (problem.y - m).T
    found, block = [], 0
    with np.errstate(all="ignore"):  # a diverging trial step is found and halved
        for segment in problem.segments:
            span = slice(block, block + segment.K)
            found.append(_condense(dx[span], dy[span], d[span], e[span]))
            block += segment.K
    return Linearised(tuple(found), m, d)


def _condense(dx: FloatArray, dy: FloatArray, d: FloatArray, e: FloatArray) -> Condensed:
    K, nx, n = dx.shape
    S, c = np.zeros((K + 1, nx, n)), np.zeros((K + 1, nx))
    S[0, :, :nx] = np.eye(nx)
    for k in range(K):
        A = dx[k, :, :nx]
        S[k + 1] = A @ S[k]
        S[k + 1, :, nx:] += dx[k, :, nx:]
        c[k + 1] = A @ c[k] + d[k]
    C = dy[:, :, :nx]
    J = C @ S[:-1]
    J[:, :, nx:] += dy[:, :, nx:]
    return Condensed(J, e - (C @ c[:-1, :, None])[:, :, 0], S, c)


def scaled_normal_equations(
    problem: Problem, segment: Condensed, sigma: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return JᵀJ and Jᵀr of one segment in scaled (x_0, θ_free)."""
    scale = np.concatenate([problem.axis.state_scales, problem.free_scales])
    weight = np.sqrt(problem.blocks.n) / sigma
    J = (segment.J * weight[None, :, None] * scale).reshape(-1, scale.size)
    r = (segment.r * weight).ravel()
    return J.T @ J, J.T @ r


def anchor_normal_equations(problem: Problem, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return JᵀJ and Jᵀr of the flow map in scaled free parameters; zeros without an anchor."""
    free = problem.free
    H, g = np.zeros((len(free), len(free))), np.zeros(len(free))
    if problem.anchor is None:
        return H, g
    c = theta[[problem.parameters.index(name) for name in problem.anchor.names]]
    inside = [i for i, name in enumerate(problem.anchor.names) if name in free]
    at = [free.index(problem.anchor.names[i]) for i in inside]
    J = problem.anchor.jacobian(c)[:, inside] * problem.free_scales[at]
    H[np.ix_(at, at)] = J.T @ J
    g[at] = -J.T @ problem.anchor(c)
    return H, g
