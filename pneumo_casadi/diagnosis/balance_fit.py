"""Fit parameters to the balances along smoothed motions: a bounded, weighted least squares.

It needs milliseconds where output error needs seconds, cannot run away from the data, and sees
each balance on its own. Its price: noise and filters bias it by a fraction of a per cent.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.diagnosis.along import AlongMotion
from pneumo_casadi.diagnosis.inverse import linearised, residuals
from pneumo_casadi.diagnosis.trajectory import Smoothed
from pneumo_casadi.output_error.anchor import Anchor
from pneumo_casadi.output_error.steps import bounded_minimum
from pneumo_casadi.parameters import FloatArray

MAX_ITERATIONS = 30
#: A step that promises less than this share of the cost ends the iteration.
TOLERANCE = 1e-5


@dataclass(frozen=True, eq=False)
class BalanceFit:
    """Parameters fitted to the balances.

    Parameters
    ----------
    theta : (n,) array
        All parameters.
    covariance : (n_free, n_free) array
        Of the model's free parameters, residuals taken for white.
    cost : float
        Σ n_e log σ_e over the balances, with half the squares of the flow map's residuals.
    residuals : tuple of (ne, m) array
        Of every record, rows that do not count included.
    converged : bool
        Whether the last step promised nothing more.
    """

    theta: FloatArray
    covariance: FloatArray
    cost: float
    residuals: tuple[FloatArray, ...]
    converged: bool


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
    free = [parameters.index(name) for name in model.free]
    scales, bounds = parameters.scales[free], (parameters.lower[free], parameters.upper[free])
    weights = np.hstack([one.used(model.axis) for one in data]).astype(float)
    n_rows = weights.sum(axis=1)
    theta = theta.copy()

    def pull(values: FloatArray) -> FloatArray:
        return np.zeros(0) if anchor is None else anchor(anchor.coefficients(parameters, values))

    def cost_of(r: FloatArray, values: FloatArray) -> tuple[float, FloatArray]:
        sigma = np.sqrt(np.sum(r**2, axis=1) / n_rows + sigma_least**2)
        squares = float(np.sum(pull(values) ** 2))
        return float(np.sum(n_rows * np.log(sigma)) + 0.5 * squares), sigma

    def residuals_at(values: FloatArray) -> tuple[FloatArray, ...]:
        return tuple(residuals(model, one, values) for one in data)

    damping, converged, iterations = 1e-6, False, 0
    H = np.eye(len(free))
    while iterations < max_iterations and not converged:
        iterations += 1
        parts = [linearised(model, one, theta) for one in data]
        r = np.hstack([part.r for part in parts]) * weights
        J = np.hstack([part.J for part in parts]) * weights[:, :, None]
        cost, sigma = cost_of(r, theta)
        e = (r / sigma[:, None]).ravel()
        A = (J / sigma[:, None, None]).reshape(e.size, -1)
        if anchor is not None:
            c = anchor.coefficients(parameters, theta)
            A, e = np.vstack([A, anchor.rows(c, model.free)]), np.concatenate([e, pull(theta)])
        A = A * scales
        H, g = A.T @ A, -A.T @ e
        lower, upper = ((bound - theta[free]) / scales for bound in bounds)
        accepted = False
        for _ in range(12):
            step = bounded_minimum(_damped(H, damping), g, lower, upper)
            promised = 0.5 * (e @ e - np.sum((e + A @ step) ** 2))
            if promised < TOLERANCE * n_rows.sum():
                converged = True
                break
            trial = theta.copy()
            trial[free] = np.clip(theta[free] + step * scales, *bounds)  # against rounding
            new, _ = cost_of(np.hstack(residuals_at(trial)) * weights, trial)
            if np.isfinite(new) and new < cost - 1e-3 * promised:
                theta, accepted = trial, True
                damping = max(damping / 10, 1e-9)
                break
            damping = max(damping * 10, 1e-6)
        if not accepted:
            break
    left = residuals_at(theta)
    cost, _ = cost_of(np.hstack(left) * weights, theta)
    covariance = np.linalg.pinv(H, hermitian=True) * np.outer(scales, scales)
    return BalanceFit(theta, covariance, cost, left, converged)


def _damped(H: FloatArray, damping: float) -> FloatArray:
    diagonal = np.diag(H)
    return H + damping * np.diag(np.maximum(diagonal, 1e-12 * diagonal.max()))
