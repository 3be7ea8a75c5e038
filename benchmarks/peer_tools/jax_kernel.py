"""The model in JAX: a scanned Runge-Kutta method, forward tangents, intervals by `vmap`."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from peer_tools.estimation import N_OUTPUTS, STATE_SCALES, Estimation
from peer_tools.gauss_newton import Linearised
from peer_tools.judging import MECHANICAL

jax.config.update("jax_enable_x64", True)


def _rates(x, theta, held, constants):
    """Return the four derivatives, in SI."""
    S_P, S_N, p_ext, v_s, centre, slope = constants
    X_1, X_2, X_3, X_4, X_5, X_6, M, f_v, F_plus, F_minus = theta[:MECHANICAL]
    p, position, v = x[:2], x[2], x[3]
    z = (p - centre) * slope
    T = [jnp.ones_like(z), z]
    for _ in range(held.shape[1] - 2):
        T.append(2 * z * T[-1] - T[-2])
    q = sum(held[:, j] * T[j] for j in range(held.shape[1]))
    s = jnp.tanh(v / v_s)
    friction = f_v * v + F_plus * (1 + s) / 2 - F_minus * (1 - s) / 2
    effort = S_P * p[0] - S_N * p[1] - (S_P - S_N) * p_ext
    return jnp.stack(
        [
            (q[0] - X_3 * p[0] * v) / (X_1 + X_2 * position),
            (q[1] + X_6 * p[1] * v) / (X_4 - X_5 * position),
            v,
            (effort - friction) / M,
        ]
    )


def _interval(x, eta, u, given, lengths, steps):
    """Return the end and the outputs (samples, 3) of one interval, scaled."""
    theta = eta * given["scales"]
    flow = theta[MECHANICAL:] if eta.shape[0] > MECHANICAL else given["known"]
    parts = jnp.split(flow, (lengths[0], lengths[0] + lengths[1]))
    zero, plus, minus = (jnp.pad(c, (0, max(lengths) - c.shape[0])) for c in parts)
    h = given["dt"] / steps

    def sample(x, u):
        opening = u[:, None]
        held = zero + plus * jnp.maximum(opening, 0) + minus * jnp.minimum(opening, 0)
        f = partial(_rates, theta=theta, held=held, constants=given["constants"])
        end = x
        for _ in range(steps):
            k_1 = f(end)
            k_2 = f(end + h / 2 * k_1)
            k_3 = f(end + h / 2 * k_2)
            k_4 = f(end + h * k_3)
            end = end + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)
        return end, x[:N_OUTPUTS]

    end, outputs = jax.lax.scan(sample, x * STATE_SCALES, u)
    return end / STATE_SCALES, outputs / STATE_SCALES[:N_OUTPUTS]


@partial(jax.jit, static_argnames=("lengths", "steps"))
def _linearise(x, eta, u, y, given, lengths, steps):
    def one(x, u, y):
        def values(z):
            end, outputs = _interval(z[:4], z[4:], u, given, lengths, steps)
            e = ((outputs - y) * given["weights"]).ravel()
            return (end, e), (end, e)

        (S, J), (end, e) = jax.jacfwd(values, has_aux=True)(jnp.concatenate([x, eta]))
        return end, S, J.T @ J, J.T @ e, e @ e / 2

    return jax.vmap(one)(x, u, y)


class Intervals:
    """A problem cut into intervals of equal length."""

    def __init__(self, problem: Estimation, samples: int) -> None:
        branches = (problem.phi, problem.psi_plus, problem.psi_minus)
        low, high = problem.p_range
        c = problem.constants
        self.steps, self.lengths = problem.steps, tuple(map(len, branches))
        self.u = jnp.asarray(problem.u.reshape(-1, samples, 2))
        self.y = jnp.asarray(problem.scaled_y.reshape(-1, samples, N_OUTPUTS))
        known = [Polynomial(b).convert(kind=Chebyshev).coef for b in branches]
        given = {
            "scales": problem.scales,
            "known": np.concatenate(known),
            "dt": problem.dt,
            "weights": problem.weights,
            "constants": np.array(
                [c["S_P"], c["S_N"], c["p_ext"], c["v_s"], (low + high) / 2, 2 / (high - low)]
            ),
        }
        self.given = {name: jnp.asarray(value) for name, value in given.items()}

    def linearise(self, x: np.ndarray, eta: np.ndarray) -> Linearised:
        """Return all intervals with their normal equations, columns (x, η)."""
        result = _linearise(x, eta, self.u, self.y, self.given, self.lengths, self.steps)
        ends, S, H, g, cost = (np.asarray(part) for part in result)
        return Linearised(ends, S, H, g, float(cost.sum()))
