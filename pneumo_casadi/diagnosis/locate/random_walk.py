"""Random-walk sizes of the unknown inputs, by Whittle's likelihood."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray

#: Range of the walks: share of a balance's signal that an input may change in one second.
WALK = (1e-4, 1e2)


def random_walk_stds(
    axis: Axis,
    defect: FloatArray,
    B: FloatArray,
    R: FloatArray,
    moving: NDArray[np.bool_],
    h: float,
) -> FloatArray:
    """Return the walk of each input that makes its balance's residuals most likely, (ne,)."""
    names = axis.motion_states
    stds = []
    for i, equation in enumerate(axis.equations):
        state = {"force": "v", "mass_flow_P": "p_P", "mass_flow_N": "p_N"}[equation]
        unit = B[:-1, names.index(state), i]
        r = defect[names.index(state)] / h / unit
        if equation == "force":
            r = np.where(moving[:-1], r, 0.0)
        measured = "x" if equation == "force" else state
        size = float(np.mean(1 / unit)) ** 2 * R[axis.outputs.index(measured)]
        stds.append(_random_walk_std(r, size, 4 if equation == "force" else 2, h))
    return np.array(stds)


def _random_walk_std(r: FloatArray, noise: float, power: int, h: float) -> float:
    """Return the walk [1/√s] of residuals r with noise that was differenced once or twice."""
    P = np.abs(np.fft.rfft(r - r.mean())[1:]) ** 2 / r.size
    half = 2 * np.sin(np.pi * np.arange(1, P.size + 1) / r.size)
    floor = noise * (half / h) ** power
    shape = h / half**2

    def cost(log_q: float) -> float:
        S = np.exp(2 * log_q) * shape + floor
        return float(np.sum(np.log(S) + P / S))

    size = np.sqrt(np.mean(r**2)) + 1e-300
    low, high = np.log(WALK[0] * size), np.log(WALK[1] * size)
    return float(np.exp(minimize_scalar(cost, bounds=(low, high), method="bounded").x))
