"""Single shooting in NumPy: many parameter sets side by side, for SciPy and lmfit."""

import numpy as np

from peer_tools.estimation import N_OUTPUTS, STATE_SCALES, Estimation, polynomial

#: Runge-Kutta steps of order four a sample.
STEPS = 2
#: Relative step of the forward differences.
DIFFERENCE = 1e-6


def start(problem: Estimation) -> np.ndarray:
    """Return the scaled unknowns: θ / start, then x_0 / `STATE_SCALES`."""
    return np.concatenate([np.ones(len(problem.names)), problem.scaled_states[0]])


def outputs(problem: Estimation, unknowns: np.ndarray) -> np.ndarray:
    """Simulate columns of unknowns (n, B) side by side; outputs over their scales, (N, 3, B)."""
    n = len(problem.names)
    theta = list(unknowns[:n] * problem.start[:, None])
    x = unknowns[n:] * STATE_SCALES[:, None]
    h = problem.dt / STEPS
    outputs = np.empty((problem.N, N_OUTPUTS, unknowns.shape[1]))

    def f(x: np.ndarray, held: list[list[float]]) -> np.ndarray:
        z = problem.z(x[:2])
        q = [polynomial(held[i], z[i]) for i in range(2)]
        return np.array(problem.rates(x, q, theta, np.tanh))

    with np.errstate(all="ignore"):  # a diverging trial ends in numbers that the caller refuses
        for k, held in enumerate(problem.flow_coefficients.tolist()):
            outputs[k] = x[:N_OUTPUTS]
            for _ in range(STEPS):
                k_1 = f(x, held)
                k_2 = f(x + h / 2 * k_1, held)
                k_3 = f(x + h / 2 * k_2, held)
                k_4 = f(x + h * k_3, held)
                x = x + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)
    return outputs / STATE_SCALES[:N_OUTPUTS, None]


def residuals(problem: Estimation, unknowns: np.ndarray) -> np.ndarray:
    """Return (ŷ - y)/σ of one set of unknowns, flat; huge where the simulation diverges."""
    y = outputs(problem, unknowns[:, None])[:, :, 0]
    e = ((y - problem.scaled_y) * problem.weights).ravel()
    return np.where(np.isfinite(e), e, 1e9)


def jacobian(problem: Estimation, unknowns: np.ndarray) -> np.ndarray:
    """Return ∂residuals/∂unknowns by forward differences, all columns in one simulation."""
    steps = DIFFERENCE * np.maximum(1.0, np.abs(unknowns))
    around = unknowns[:, None] + np.hstack([np.zeros((unknowns.size, 1)), np.diag(steps)])
    y = outputs(problem, around) * problem.weights[:, None]
    return ((y[:, :, 1:] - y[:, :, :1]) / steps).reshape(-1, unknowns.size)
