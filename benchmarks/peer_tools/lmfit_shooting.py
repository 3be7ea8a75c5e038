"""lmfit: `minimize` by Levenberg-Marquardt on the same single-shooting simulation."""

import lmfit
import numpy as np

from peer_tools import shooting
from peer_tools.estimation import STATE_SCALES, Answer, Estimation


def version() -> str:
    """Return the tool's version."""
    return lmfit.__version__


def build(problem: Estimation) -> lmfit.Parameters:
    """Name the unknowns."""
    parameters = lmfit.Parameters()
    names = (*problem.names, *(f"x_0{i}" for i in range(4)))
    for name, value in zip(names, shooting.start(problem), strict=True):
        parameters.add(name, value=value)
    return parameters


def solve(problem: Estimation, built: lmfit.Parameters) -> Answer:
    """Minimise; the Jacobian comes from simulations side by side."""

    def unknowns(parameters: lmfit.Parameters) -> np.ndarray:
        return np.array(list(parameters.valuesdict().values()))

    result = lmfit.minimize(
        lambda parameters: shooting.residuals(problem, unknowns(parameters)),
        built,
        method="leastsq",
        Dfun=lambda parameters: shooting.jacobian(problem, unknowns(parameters)),
    )
    best = unknowns(result.params)
    n = len(problem.names)
    theta, x_0 = best[:n] * problem.start, best[n:] * STATE_SCALES
    return Answer(theta, x_0, result.chisqr / 2, result.message, result.nfev)
