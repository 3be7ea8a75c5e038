"""Fit parameters to the balances along smoothed motions: a bounded, weighted least squares.

It needs milliseconds where output error needs seconds, cannot run away from the data, and sees
each balance on its own. Its price: noise and filters bias it by a fraction of a per cent.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from pneumo_casadi.diagnosis.along import AlongMotion
from pneumo_casadi.diagnosis.inverse import linearised, residuals
from pneumo_casadi.diagnosis.trajectory import Smoothed
from pneumo_casadi.output_error.anchor import Anchor
from pneumo_casadi.parameters import FloatArray, Parameters

MAX_ITERATIONS = 30
#: A step that promises less than this share of the cost ends the iteration.
TOLERANCE = 1e-5


@dataclass(frozen=True, eq=False)
class BalanceFit:
    """Parameters fitted to the balances.

    Parameters
    ----------
    model : AlongMotion
        With the axis at the fitted values.
    theta : (n,) array
        All parameters.
    sigma : (ne,) array
        Root mean square residual of each balance [kg/s, kg/s, N].
    covariance : (n_free, n_free) array
        Of the free parameters, nominal ones first, residuals taken for white.
    cost : float
        Σ n_e log σ_e over the balances, with half the squares of the flow map's residuals.
    iterations : int
        Steps taken.
    converged : bool
        Whether the last step promised nothing more.
    """

    model: AlongMotion
    theta: FloatArray
    sigma: FloatArray
    covariance: FloatArray
    cost: float
    iterations: int
    converged: bool

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the free parameters, in the order of `covariance`."""
        return (*self.model.nominal, *self.model.own)

    def value(self, name: str) -> float:
        """Return a parameter."""
        return float(self.theta[self.model.axis.parameters.index(name)])


def used(model: AlongMotion, data: Smoothed) -> FloatArray:
    """Return the weight (0 or 1) of every row of every balance, shape (ne, m)."""
    weight = np.ones((len(model.axis.equations), data.m))
    weight[model.axis.equations.index("force")] = data.moving
    return weight


def fit_balances(
    model: AlongMotion,
    data: Sequence[Smoothed],
    anchor: Anchor | None,
    theta: FloatArray,
    sigma_least: FloatArray,
    max_iterations: int = MAX_ITERATIONS,
) -> BalanceFit:
    """Minimise the balances' residuals over the free parameters within their bounds.

    Parameters
    ----------
    theta : (n,) array
        Start.
    sigma_least : (ne,) array
        What the sensors' noise alone leaves in each balance.
    """
    parameters = model.axis.parameters
    free = [parameters.index(name) for name in (*model.nominal, *model.own)]
    scales = parameters.scales[free]
    weights = [used(model, one) for one in data]
    theta = theta.copy()

    def cost_at(values: FloatArray) -> tuple[float, FloatArray]:
        r = np.concatenate(
            [residuals(model, one, values)[:, :] * w for one, w in zip(data, weights, strict=True)],
            axis=1,
        )
        return _cost(r, n_rows, anchor_squares(anchor, parameters, values), sigma_least)

    n_rows = np.sum([w.sum(axis=1) for w in weights], axis=0)
    damping, converged, iterations = 1e-6, False, 0
    H = np.eye(len(free))
    while iterations < max_iterations and not converged:
        iterations += 1
        parts = [linearised(model, one, theta) for one in data]
        r = np.concatenate([p.r * w for p, w in zip(parts, weights, strict=True)], axis=1)
        J = np.concatenate(
            [p.J * w[:, :, None] for p, w in zip(parts, weights, strict=True)], axis=1
        )
        cost, sigma = _cost(r, n_rows, anchor_squares(anchor, parameters, theta), sigma_least)
        e = (r / sigma[:, None]).ravel()
        A = (J / sigma[:, None, None]).reshape(e.size, -1)
        if anchor is not None:
            at = [parameters.index(name) for name in anchor.names]
            c = theta[at]
            rows, slopes = np.zeros((anchor.n, len(free))), anchor.jacobian(c)
            for k, i in enumerate(at):
                if i in free:
                    rows[:, free.index(i)] = slopes[:, k]
            A, e = np.vstack([A, rows]), np.concatenate([e, anchor(c)])
        A = A * scales
        H = A.T @ A
        lower = (parameters.lower[free] - theta[free]) / scales
        upper = (parameters.upper[free] - theta[free]) / scales
        accepted = False
        for _ in range(12):
            step = _bounded_step(A, e, H, damping, lower, upper)
            promised = 0.5 * (e @ e - np.sum((e + A @ step) ** 2))
            if promised < TOLERANCE * n_rows.sum():
                converged = True
                break
            trial = theta.copy()
            trial[free] = np.clip(  # against rounding
                theta[free] + step * scales, parameters.lower[free], parameters.upper[free]
            )
            new, _ = cost_at(trial)
            if np.isfinite(new) and new < cost - 1e-3 * promised:
                theta, accepted = trial, True
                damping = max(damping / 10, 1e-9)
                break
            damping = max(damping * 10, 1e-6)
        if not accepted:
            break
    r_final, sigma = cost_at(theta)
    scaled = np.linalg.pinv(H, hermitian=True) * np.outer(scales, scales)
    return BalanceFit(model, theta, sigma, scaled, r_final, iterations, converged)


def _bounded_step(
    A: FloatArray,
    e: FloatArray,
    H: FloatArray,
    damping: float,
    lower: FloatArray,
    upper: FloatArray,
) -> FloatArray:
    D = np.sqrt(damping * np.maximum(np.diag(H), 1e-12 * np.diag(H).max()) + 1e-300)
    g = A.T @ e
    K = H + np.diag(D**2)
    step = np.linalg.lstsq(K, -g, rcond=1e-14)[0]
    if np.all(step >= lower) and np.all(step <= upper):
        return np.asarray(step)
    s = np.sqrt(np.diag(K))
    L = np.linalg.cholesky(K / np.outer(s, s) + 1e-12 * np.eye(len(g)))
    rhs = np.linalg.solve(L, -g / s)
    lo, hi = np.minimum(lower, 0) * s, np.maximum(upper, 0) * s
    hi = np.where(hi <= lo, lo + 1e-12, hi)
    return np.asarray(lsq_linear(L.T, rhs, (lo, hi), method="bvls").x / s)


def anchor_squares(anchor: Anchor | None, parameters: Parameters, theta: FloatArray) -> float:
    """Return the sum of squares of the flow map's residuals."""
    if anchor is None:
        return 0.0
    return float(np.sum(anchor(theta[[parameters.index(n) for n in anchor.names]]) ** 2))


def _cost(
    r: FloatArray, n_rows: FloatArray, anchored: float, least: FloatArray
) -> tuple[float, FloatArray]:
    sigma = np.sqrt(np.sum(r**2, axis=1) / n_rows + least**2)
    return float(np.sum(n_rows * np.log(sigma)) + 0.5 * anchored), sigma
