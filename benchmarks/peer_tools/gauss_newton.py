"""Gauss-Newton by hand: windows of intervals, condensed to parameters and initial states.

The unknowns are the scaled parameters η and the scaled states where intervals begin. A backend
simulates all intervals with their sensitivities; what is left is linear algebra of the size of the
parameters. With one interval a window this is single shooting by Levenberg and Marquardt's
damped steps; with several it is multiple shooting by full steps.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from peer_tools.estimation import STATE_SCALES, Answer, Estimation
from peer_tools.judging import MECHANICAL, map_jacobian

#: Size of a step, root mean square in standard deviations, at which a point counts as optimal.
TOLERANCE = 1e-3
#: Defects between intervals that count as closed, in scaled states.
CLOSED = 1e-6
ITERATIONS = 60
#: First damping of single shooting, and the factors by which it falls and rises.
DAMPING, FALL, RISE = 1e-3, 0.1, 10.0


@dataclass(frozen=True)
class Linearised:
    """All I intervals at one point, to m columns (x, η): ends, slopes, JᵀJ, Jᵀe and ½ eᵀe."""

    ends: np.ndarray
    S: np.ndarray
    H: np.ndarray
    g: np.ndarray
    cost: float


#: ``(x (I, 4), η (n,)) -> Linearised``, everything scaled.
Backend = Callable[[np.ndarray, np.ndarray], Linearised]


@dataclass(frozen=True)
class Step:
    """What a linearised problem asks for: changes of nodes and η, and its size."""

    x: np.ndarray
    eta: np.ndarray
    size: float


def interval_samples(problem: Estimation, longest: float | None) -> int:
    """Return the samples of an interval: a window, or the longest divisor of it up to `longest`."""
    n = problem.N // problem.windows
    most = n if longest is None else round(longest / problem.dt)
    return max(k for k in range(1, min(n, most) + 1) if n % k == 0)


def solve(problem: Estimation, backend: Backend, samples: int) -> Answer:
    """Minimise from the problem's start, with intervals of so many samples."""
    x = problem.scaled_states[::samples]
    eta = problem.start / problem.scales
    single = samples * problem.windows == problem.N
    damping = DAMPING if single else 0.0
    at, own = backend(x, eta), _map_part(problem, eta)
    status, iterations = "iterations exhausted", 0
    while iterations < ITERATIONS:
        iterations += 1
        step = condensed_step(problem, at, own, x, damping)
        trial = backend(x + step.x, eta + step.eta)
        ahead = _map_part(problem, eta + step.eta)
        better = trial.cost + ahead[2] <= at.cost + own[2]
        if single and not better and step.size > TOLERANCE:
            damping *= RISE
            continue
        x, eta, at, own = x + step.x, eta + step.eta, trial, ahead
        damping *= FALL
        if not np.isfinite(at.cost):
            status = "diverged"
            break
        if step.size <= TOLERANCE and np.max(np.abs(_defects(problem, at, x)), initial=0) < CLOSED:
            status = "converged"
            break
    firsts = x[:: len(x) // problem.windows] * STATE_SCALES
    return Answer(eta * problem.scales, firsts.ravel(), at.cost + own[2], status, iterations)


def condensed_step(
    problem: Estimation,
    at: Linearised,
    own: tuple[np.ndarray, np.ndarray, float],
    x: np.ndarray,
    damping: float,
) -> Step:
    """Return the step of all unknowns: nodes follow initial states and η, windows share η."""
    W, nx, m = problem.windows, x.shape[1], at.S.shape[2]
    K, n = len(x) // W, m - nx
    S, H_k, g_k = (part.reshape(W, K, *part.shape[1:]) for part in (at.S, at.H, at.g))
    d = _defects(problem, at, x)
    P, c = np.zeros((W, K, m, m)), np.zeros((W, K, nx))
    P[:, 0, :nx, :nx] = np.eye(nx)
    P[:, :, nx:, nx:] = np.eye(n)
    for k in range(K - 1):
        P[:, k + 1, :nx] = S[:, k] @ P[:, k]
        c[:, k + 1] = (S[:, k, :, :nx] @ c[:, k, :, None])[..., 0] + d[:, k]
    moved = g_k + (H_k[..., :nx] @ c[..., None])[..., 0]
    H = (P.swapaxes(2, 3) @ (H_k @ P)).sum(axis=1)
    g = (P.swapaxes(2, 3) @ moved[..., None])[..., 0].sum(axis=1)
    diagonal = np.arange(nx)
    H[:, diagonal, diagonal] *= 1 + damping
    # Every window's initial state is eliminated; what is left is dense in η.
    G = np.linalg.solve(H[:, :nx, :nx], np.concatenate([H[:, :nx, nx:], g[:, :nx, None]], axis=2))
    A = H[:, nx:, nx:].sum(axis=0) + own[0]
    A[np.diag_indices(n)] *= 1 + damping
    A -= (H[:, nx:, :nx] @ G[:, :, :n]).sum(axis=0)
    b = g[:, nx:].sum(axis=0) + own[1] - (H[:, nx:, :nx] @ G[:, :, n:])[..., 0].sum(axis=0)
    eta = -np.linalg.solve(A, b)
    x_0 = -G[:, :, n] - G[:, :, :n] @ eta
    change = np.concatenate([x_0, np.tile(eta, (W, 1))], axis=1)
    nodes = (P[:, :, :nx] @ change[:, None, :, None])[..., 0] + c
    return Step(nodes.reshape(-1, nx), eta, float(np.sqrt(eta @ A @ eta / n)))


def _defects(problem: Estimation, at: Linearised, x: np.ndarray) -> np.ndarray:
    """Return ends less the nodes that follow them, shape (windows, K - 1, 4)."""
    W, nx = problem.windows, x.shape[1]
    return at.ends.reshape(W, -1, nx)[:, :-1] - x.reshape(W, -1, nx)[:, 1:]


def _map_part(problem: Estimation, eta: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return JᵀJ, Jᵀe and ½ eᵀe of the metered flow map in η."""
    n = eta.size
    H, g = np.zeros((n, n)), np.zeros(n)
    if problem.flow_map is None:
        return H, g, 0.0
    J = map_jacobian(problem) * problem.scales[MECHANICAL:]
    e = J @ eta[MECHANICAL:] - problem.flow_map.q_m / problem.flow_map.sigma
    H[MECHANICAL:, MECHANICAL:], g[MECHANICAL:] = J.T @ J, J.T @ e
    return H, g, 0.5 * float(e @ e)
