"""Single shooting by hand: numba with forward sensitivities, SciPy's `least_squares`."""

import numba
import numpy as np
import scipy
from scipy.linalg import block_diag
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from peer_tools import gauss_newton
from peer_tools.estimation import STATE_SCALES, Answer, Estimation
from peer_tools.judging import MECHANICAL, map_jacobian
from peer_tools.numba_kernel import Intervals


def version() -> str:
    """Return the tool's version."""
    return f"{numba.__version__}, SciPy {scipy.__version__}"


def build(problem: Estimation) -> Intervals:
    """One interval is one window."""
    return Intervals(problem, gauss_newton.interval_samples(problem, None))


def solve(problem: Estimation, built: Intervals) -> Answer:
    """Minimise by the trust-region method; rows of the flow map follow those of the records."""
    n, W = len(problem.names), problem.windows

    def windows(z: np.ndarray, columns: bool) -> list:
        def run(i: int):
            return built.residuals(i, z[n + 4 * i : n + 4 * i + 4], z[:n], columns)[:2]

        return list(built.pool.map(run, range(W)))

    def residuals(z: np.ndarray) -> np.ndarray:
        e = np.concatenate([e.ravel() for e, _ in windows(z, False)] + [map_rows(problem, z)[0]])
        return np.where(np.isfinite(e), e, 1e9)

    def jacobian(z: np.ndarray) -> np.ndarray:
        parts = [J.reshape(-1, n + 4) for _, J in windows(z, True)]
        to_theta = np.vstack([J[:, :n] for J in parts])
        J = np.hstack([to_theta, block_diag(*(J[:, n:] for J in parts))])
        return np.vstack([J, map_rows(problem, z)[1]])

    start = np.concatenate(
        [problem.start / problem.scales, (problem.starts / STATE_SCALES).ravel()]
    )
    with threadpool_limits(1):
        result = least_squares(residuals, start, jacobian, method="trf", x_scale="jac")
    x_0 = result.x[n:].reshape(-1, 4) * STATE_SCALES
    theta = result.x[:n] * problem.scales
    return Answer(theta, x_0.ravel(), result.cost, result.message, result.nfev)


def map_rows(problem: Estimation, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return residuals and Jacobian of the metered flow map, without rows where it is known."""
    points, n = problem.flow_map, len(problem.names)
    if points is None:
        return np.zeros(0), np.zeros((0, z.size))
    J = np.zeros((points.u.size, z.size))
    J[:, MECHANICAL:n] = map_jacobian(problem) * problem.scales[MECHANICAL:]
    return J @ z - points.q_m / points.sigma, J
