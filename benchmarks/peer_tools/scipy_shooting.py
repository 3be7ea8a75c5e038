"""SciPy: `least_squares` on a single-shooting simulation in NumPy."""

import scipy
from scipy.optimize import least_squares

from peer_tools import shooting
from peer_tools.estimation import STATE_SCALES, Answer, Estimation


def version() -> str:
    """Return the tool's version."""
    return scipy.__version__


def build(problem: Estimation) -> None:
    """Nothing to be built."""


def solve(problem: Estimation, built: None) -> Answer:
    """Minimise by the trust-region method, Jacobian by simulations side by side."""
    result = least_squares(
        lambda unknowns: shooting.residuals(problem, unknowns),
        shooting.start(problem),
        lambda unknowns: shooting.jacobian(problem, unknowns),
        method="trf",
        x_scale="jac",
    )
    n = len(problem.names)
    theta, x_0 = result.x[:n] * problem.start, result.x[n:] * STATE_SCALES
    return Answer(theta, x_0, result.cost, result.message, result.nfev)
