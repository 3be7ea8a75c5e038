"""Rauch-Tung-Striebel smoother of deviations and unknown inputs."""

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray

#: Distance of the nodes [s]; the filter of the measurements leaves their noise white there.
NODE = 8e-3


def discretise(slope: FloatArray, B: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
    """Return transition matrices (K, nx, nx) and input columns (K, nx, ne) of one interval."""
    K, nx, ne = B.shape
    A = slope.T.reshape(K, nx, nx)
    M = np.zeros((K, nx + ne, nx + ne))
    M[:, :nx, :nx], M[:, :nx, nx:] = h * A, h * B
    # Scaling and squaring: friction about standstill is stiff.
    squarings = max(0, int(np.ceil(np.log2(max(np.abs(h * A).sum(axis=2).max(), 1e-9)))) + 3)
    M = M / 2.0**squarings
    E = term = np.broadcast_to(np.eye(nx + ne), M.shape)
    for order in range(1, 7):
        term = term @ M / order
        E = E + term
    for _ in range(squarings):
        E = E @ E
    return E[:, :nx, :nx], E[:, :nx, nx:]


def smooth_inputs(
    axis: Axis,
    F: FloatArray,
    G: FloatArray,
    defect: FloatArray,
    R: FloatArray,
    Q: FloatArray,
    sticks: NDArray[np.bool_],
    stick: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Smooth deviations ξ and inputs w; return w, its deviation, and ξ."""
    K, nx, ne = G.shape
    n = nx + ne
    scale = _scales(axis, R, G, Q)
    T = np.zeros((K, n, n))
    T[:, :nx, :nx], T[:, :nx, nx:], T[:, nx:, nx:] = F, G, np.eye(ne)
    T = T * scale / scale[:, None]
    d = np.zeros((K - 1, n))
    d[:, :nx] = defect.T
    d /= scale
    V = np.zeros((K, n))
    V[:, nx:] = Q
    # While the axis sticks, friction is whatever keeps it there.
    V[sticks, axis.motion_states.index("v")] = stick**2
    V /= scale**2
    H = np.zeros((len(axis.outputs), n))
    for row, name in enumerate(axis.outputs):
        H[row, axis.motion_states.index(name)] = 1.0
    H = H * scale / np.sqrt(R)[:, None]
    z, P, before, P_before = _forward(T, d, V, H)
    for k in range(K - 2, -1, -1):
        gain = np.linalg.solve(P_before[k + 1], T[k] @ P[k]).T
        z[k] += gain @ (z[k + 1] - before[k + 1])
        P[k] += gain @ (P[k + 1] - P_before[k + 1]) @ gain.T
    variance = np.maximum(np.diagonal(P, axis1=1, axis2=2), 0.0).T * scale[:, None] ** 2
    z = z.T * scale[:, None]
    return z[nx:], np.sqrt(variance[nx:]), z[:nx]


def _forward(
    T: FloatArray, d: FloatArray, V: FloatArray, H: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Filter; all measurements of the deviations are zero with unit variance."""
    K, n, _ = T.shape
    z, before = np.zeros((K, n)), np.zeros((K, n))
    P, P_before = np.zeros((K, n, n)), np.zeros((K, n, n))
    mean, covariance = np.zeros(n), np.eye(n) * 1e4
    unit = np.eye(len(H))
    for k in range(K):
        if k:
            mean = T[k - 1] @ mean + d[k - 1]
            covariance = T[k - 1] @ covariance @ T[k - 1].T
            covariance[np.diag_indices(n)] += V[k - 1]
        before[k], P_before[k] = mean, covariance
        PH = covariance @ H.T
        gain = np.linalg.solve(H @ PH + unit, PH.T).T
        mean = mean - gain @ (H @ mean)
        covariance = covariance - gain @ PH.T
        covariance = (covariance + covariance.T) / 2
        z[k], P[k] = mean, covariance
    return z, P, before, P_before


def _scales(axis: Axis, R: FloatArray, G: FloatArray, Q: FloatArray) -> FloatArray:
    """Return sizes of ξ and w, so that all covariances are near one, (nx + ne,)."""
    names = axis.motion_states
    size = np.ones(len(names))
    for row, name in enumerate(axis.outputs):
        size[names.index(name)] = np.sqrt(R[row])
    size[names.index("v")] = size[names.index("x")] / NODE
    return np.concatenate([size, 10 * np.sqrt(Q)])
