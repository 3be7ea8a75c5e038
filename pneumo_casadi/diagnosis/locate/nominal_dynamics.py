"""The nominal axis along the smoothed motion: its right-hand side and the size of its terms."""

import casadi as ca
import numpy as np

from pneumo_casadi.estimation.equation_error.smoothed_motion import (
    SmoothedMotion,
)
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray


def evaluate_dynamics(
    axis: Axis, theta: FloatArray, data: SmoothedMotion
) -> tuple[FloatArray, FloatArray]:
    """Return f (nx, N) and ∂f/∂x (nx, nx, N) of the nominal axis along the motion."""
    sym = axis.symbol.sym
    x, u = sym("x", len(axis.states)), sym("u", len(axis.inputs))
    f = axis.rhs(x, u, theta)
    both = ca.Function("along", [x, u], [f, ca.densify(ca.vec(ca.jacobian(f, x)))])
    rates, slopes = both.map(data.N)(data.x, data.u)
    nx = len(axis.states)
    return np.asarray(rates), np.asarray(slopes).reshape(nx, nx, data.N).transpose(1, 0, 2)


def signals_of(axis: Axis, theta: FloatArray, data: SmoothedMotion) -> FloatArray:
    """Return the root mean square of each balance's own terms [kg/s, kg/s, N]."""
    rows = []
    if axis.kind.gas_chambers:
        rows += list(np.asarray(axis.valve_flow.map(data.N)(data.x, data.u, theta)))
    rows.append(axis.driving_force(data.x, data.u))
    return np.asarray(np.sqrt(np.mean(np.square(rows), axis=1)))
