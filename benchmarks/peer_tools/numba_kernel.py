"""The model and its forward sensitivities by hand, compiled by numba: all of an interval."""

from concurrent.futures import ThreadPoolExecutor
from functools import cached_property

import numba
import numpy as np
from numpy.polynomial import Chebyshev, Polynomial
from threadpoolctl import threadpool_limits

from peer_tools.estimation import N_OUTPUTS, STATE_SCALES, Estimation
from peer_tools.gauss_newton import Linearised
from peer_tools.judging import MECHANICAL

#: Threads among which intervals are shared.
THREADS = 2
FAST = {"nogil": True, "cache": True, "fastmath": {"nsz", "arcp", "contract", "afn", "reassoc"}}


@numba.njit(**FAST)
def _rates(x, S, f, dS, theta, held, opening, lengths, constants, T, dT, n_free):
    """Write f(x) and its derivatives to (θ, x_0) at one stage; columns are θ first, then x_0."""
    S_P, S_N, p_ext, v_s, centre, slope = constants
    X_1, X_2, X_3, X_4, X_5, X_6, M, f_v, F_plus, F_minus = theta
    p_P, p_N, position, v = x[0], x[1], x[2], x[3]
    n = held.shape[1]
    for i in range(2):
        z = (x[i] - centre) * slope
        T[i, 0], T[i, 1], dT[0], dT[1] = 1.0, z, 0.0, 1.0
        q, dq = held[i, 0] + held[i, 1] * z, held[i, 1]
        for j in range(2, n):
            T[i, j] = 2 * z * T[i, j - 1] - T[i, j - 2]
            dT[j] = 2 * T[i, j - 1] + 2 * z * dT[j - 1] - dT[j - 2]
            q += held[i, j] * T[i, j]
            dq += held[i, j] * dT[j]
        if i == 0:
            q_P, dq_P = q, dq * slope
        else:
            q_N, dq_N = q, dq * slope
    V_P, V_N = 1 / (X_1 + X_2 * position), 1 / (X_4 - X_5 * position)
    s = np.tanh(v / v_s)
    friction = f_v * v + F_plus * (1 + s) / 2 - F_minus * (1 - s) / 2
    f[0] = (q_P - X_3 * p_P * v) * V_P
    f[1] = (q_N + X_6 * p_N * v) * V_N
    f[2] = v
    f[3] = (S_P * p_P - S_N * p_N - (S_P - S_N) * p_ext - friction) / M
    columns = S.shape[1]
    if columns == 0:
        return
    a_00, a_02, a_03 = (dq_P - X_3 * v) * V_P, -f[0] * X_2 * V_P, -X_3 * p_P * V_P
    a_11, a_12, a_13 = (dq_N + X_6 * v) * V_N, f[1] * X_5 * V_N, X_6 * p_N * V_N
    a_30, a_31 = S_P / M, -S_N / M
    a_33 = -(f_v + (F_plus + F_minus) / 2 * (1 - s * s) / v_s) / M
    for j in range(columns):
        dS[0, j] = a_00 * S[0, j] + a_02 * S[2, j] + a_03 * S[3, j]
        dS[1, j] = a_11 * S[1, j] + a_12 * S[2, j] + a_13 * S[3, j]
        dS[2, j] = S[3, j]
        dS[3, j] = a_30 * S[0, j] + a_31 * S[1, j] + a_33 * S[3, j]
    dS[0, 0] -= f[0] * V_P
    dS[0, 1] -= f[0] * position * V_P
    dS[0, 2] -= p_P * v * V_P
    dS[1, 3] -= f[1] * V_N
    dS[1, 4] += f[1] * position * V_N
    dS[1, 5] += p_N * v * V_N
    dS[3, 6] -= f[3] / M
    dS[3, 7] -= v / M
    dS[3, 8] -= (1 + s) / (2 * M)
    dS[3, 9] += (1 - s) / (2 * M)
    if n_free == 10:
        return
    for i in range(2):
        V = V_P if i == 0 else V_N
        for j in range(lengths[0]):
            dS[i, 10 + j] += T[i, j] * V
        first, count = 10 + lengths[0], lengths[1]
        if opening[i] < 0:
            first, count = first + lengths[1], lengths[2]
        for j in range(count):
            dS[i, first + j] += opening[i] * T[i, j] * V


@numba.njit(**FAST)
def simulate(x, theta, flow, lengths, u, constants, dt, steps, S, outputs, J):
    """Run one interval from x in place; outputs (n, 3); with columns also S and J (n, 3, m)."""
    columns, width = S.shape[1], max(lengths[0], lengths[1], lengths[2], 2)
    held, T, dT = np.zeros((2, width)), np.empty((2, width)), np.empty(width)
    f, dS = np.empty(4), np.empty((4, columns))
    x_1, S_1 = np.empty(4), np.empty((4, columns))
    sum_f, sum_S = np.empty(4), np.empty((4, columns))
    h = dt / steps
    n_free = columns - 4
    for k in range(u.shape[0]):
        for i in range(3):
            outputs[k, i] = x[i]
            for j in range(columns):
                J[k, i, j] = S[i, j]
        for i in range(2):
            plus, minus = max(u[k, i], 0.0), min(u[k, i], 0.0)
            held[i] = 0.0
            for j in range(lengths[0]):
                held[i, j] = flow[j]
            for j in range(lengths[1]):
                held[i, j] += plus * flow[lengths[0] + j]
            for j in range(lengths[2]):
                held[i, j] += minus * flow[lengths[0] + lengths[1] + j]
        for _ in range(steps):
            for stage in range(4):
                if stage == 0:
                    _rates(x, S, f, dS, theta, held, u[k], lengths, constants, T, dT, n_free)
                else:
                    _rates(x_1, S_1, f, dS, theta, held, u[k], lengths, constants, T, dT, n_free)
                share = h / 6 if stage in (0, 3) else h / 3
                span = h if stage == 2 else h / 2
                for i in range(4):
                    sum_f[i] = (x[i] if stage == 0 else sum_f[i]) + share * f[i]
                    x_1[i] = x[i] + span * f[i]
                    if stage == 0:
                        for j in range(columns):
                            sum_S[i, j] = S[i, j] + share * dS[i, j]
                            S_1[i, j] = S[i, j] + span * dS[i, j]
                    else:
                        for j in range(columns):
                            sum_S[i, j] += share * dS[i, j]
                            S_1[i, j] = S[i, j] + span * dS[i, j]
            x[:] = sum_f
            S[:] = sum_S


class Intervals:
    """A problem cut into intervals of equal length, simulated in threads."""

    def __init__(self, problem: Estimation, samples: int) -> None:
        branches = (problem.phi, problem.psi_plus, problem.psi_minus)
        low, high = problem.p_range
        c = problem.constants
        self.problem = problem
        self.lengths = tuple(map(len, branches))
        self.known = np.concatenate([Polynomial(b).convert(kind=Chebyshev).coef for b in branches])
        self.constants = (
            *(float(c[name]) for name in ("S_P", "S_N", "p_ext", "v_s")),
            (low + high) / 2,
            2 / (high - low),
        )
        self.u = np.ascontiguousarray(problem.u).reshape(-1, samples, 2)
        self.y = problem.scaled_y.reshape(-1, samples, N_OUTPUTS)

    def run(self, i: int, x: np.ndarray, theta: np.ndarray, S: np.ndarray, J: np.ndarray):
        """Run interval i in place from x, in SI; return its outputs (samples, 3)."""
        flow = theta[MECHANICAL:] if theta.size > MECHANICAL else self.known
        mechanical = tuple(theta[:MECHANICAL].tolist())
        outputs = np.empty((self.u.shape[1], N_OUTPUTS))
        steps, dt = self.problem.steps, self.problem.dt
        given = (self.lengths, self.u[i], self.constants, dt, steps)
        simulate(x, mechanical, flow, *given, S, outputs, J)
        return outputs

    def residuals(self, i: int, x: np.ndarray, eta: np.ndarray, columns: bool):
        """Return e (samples, 3), J (samples, 3, m), the end and S of interval i, all scaled.

        Columns are η first, then x; none at all without `columns`.
        """
        problem = self.problem
        n = eta.size
        m = n + x.size if columns else 0
        S, J = np.zeros((x.size, m)), np.empty((self.u.shape[1], N_OUTPUTS, m))
        if columns:
            S[:, n:] = np.eye(x.size)
        state = x * STATE_SCALES
        outputs = self.run(i, state, eta * problem.scales, S, J)
        e = (outputs / STATE_SCALES[:N_OUTPUTS] - self.y[i]) * problem.weights
        if columns:
            scale = np.concatenate([problem.scales, STATE_SCALES])
            J *= scale / problem.sigma[:, None]
            S *= scale / STATE_SCALES[:, None]
        return e, J, state / STATE_SCALES, S

    @cached_property
    def pool(self) -> ThreadPoolExecutor:
        """Threads; the kernel releases the interpreter."""
        return ThreadPoolExecutor(THREADS)

    def linearise(self, x: np.ndarray, eta: np.ndarray) -> Linearised:
        """Return all intervals with their normal equations, columns (x, η)."""
        count, n, nx = len(x), eta.size, x.shape[1]
        m = n + nx
        ends, S = np.empty((count, nx)), np.empty((count, nx, m))
        H, g, costs = np.empty((count, m, m)), np.empty((count, m)), np.empty(count)
        order = np.concatenate([np.arange(n, m), np.arange(n)])

        def work(first: int) -> None:
            for i in range(first, count, THREADS):
                e, J, ends[i], S_i = self.residuals(i, x[i], eta, True)
                J, e = J.reshape(-1, m), e.ravel()
                S[i] = S_i[:, order]
                H[i], g[i] = (J.T @ J)[order][:, order], (J.T @ e)[order]
                costs[i] = e @ e / 2

        # Threads of the linear algebra inside these threads would wait for each other.
        with threadpool_limits(1):
            list(self.pool.map(work, range(THREADS)))
        return Linearised(ends, S, H, g, float(costs.sum()))
