"""The nominal axis along the smoothed motion: its right-hand side and the size of its terms."""

from collections.abc import Mapping
from functools import lru_cache

import casadi as ca
import numpy as np

from pneumo_casadi.estimation.equation_error.balance_code import along_record
from pneumo_casadi.estimation.equation_error.smoothed_motion import (
    SmoothedMotion,
)
from pneumo_casadi.model.along_record import RecordFunction
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray


def evaluate_dynamics(
    axis: Axis, theta: FloatArray, data: SmoothedMotion
) -> tuple[FloatArray, FloatArray]:
    """Return f (nx, N) and ∂f/∂x (nx, nx, N) of the nominal axis along the motion."""
    rates, slopes = _functions(axis)["dynamics"].evaluate(data.N, data.x, data.u, theta)
    nx = len(axis.states)
    return rates, slopes.reshape(nx, nx, data.N).transpose(1, 0, 2)


def signals_of(axis: Axis, theta: FloatArray, data: SmoothedMotion) -> FloatArray:
    """Return the root mean square of each balance's own terms [kg/s, kg/s, N]."""
    rows: list[FloatArray] = []
    if axis.kind.gas_chambers:
        rows += [*_functions(axis)["valve_flow"].evaluate(data.N, data.x, data.u, theta)[0]]
    rows.append(axis.driving_force(data.x, data.u))
    return np.asarray(np.sqrt(np.mean(np.square(rows), axis=1)))


@lru_cache(maxsize=2)  # those of one case are asked for again and again
def _functions(axis: Axis) -> Mapping[str, RecordFunction]:
    sym, sizes = axis.symbol.sym, (len(axis.states), len(axis.inputs), len(axis.parameters))
    x, u, theta = (sym(name, n) for name, n in zip(("x", "u", "theta"), sizes, strict=True))
    both = [axis.rhs(x, u, theta), ca.densify(ca.vec(axis.slopes(x, u, theta)))]
    functions = [ca.Function("dynamics", [x, u, theta], both)]
    if axis.kind.gas_chambers:
        functions.append(axis.valve_flow)
    return along_record(functions)
