"""The parameters of a run as one record that the kernels read by name."""

from collections.abc import Sequence
from math import inf, pi, radians, sin
from typing import Any

import numpy as np

from pneumo_casadi.data import AntiWindup, CascadeController, PidController
from pneumo_casadi.errors import ModelError
from pneumo_casadi.virtual_bench.axis import VirtualAxis
from pneumo_casadi.virtual_bench.catalogue import ALL_FORMS
from pneumo_casadi.virtual_bench.effect import VirtualEffect
from pneumo_casadi.virtual_bench.kernels.control import (
    CASCADE,
    CLAMPED,
    GOES_ON,
    PID,
    PROPORTIONAL,
    TRACKED,
)

WINDUPS = {
    AntiWindup.NONE: float(GOES_ON),
    AntiWindup.CLAMPING: float(CLAMPED),
    AntiWindup.BACK_CALCULATION: float(TRACKED),
}


def _axis_values(axis: VirtualAxis) -> dict[str, float]:
    valve, sensors = axis.valve, axis.sensors
    tau = 1.0 / (2.0 * pi * sensors.bandwidth) if sensors.bandwidth > 0.0 else 0.0
    plain = ("M", "S_P", "S_N", "V_P0", "V_N0", "k_P", "k_N", "f_v", "F_c_plus", "F_c_minus")
    gas = ("p_ext", "p_supply", "T", "r", "gain", "u_max")
    edges = ("k", "lap", "leak", "b", "m")
    return {
        **{name: getattr(axis, name) for name in (*plain, *gas)},
        "half": axis.stroke / 2,
        "clearance": valve.clearance,
        "closing": valve.closing,
        **{
            f"{name}_{side}": getattr(valve, f"{name}_{side}")
            for name in edges
            for side in ("supply", "exhaust")
        },
        **{name: getattr(sensors, name) for name in ("p_quantum", "x_quantum", "u_quantum")},
        "sensor_tau": tau,
        "slope": sin(radians(axis.angle_deg)),
        **_law_values(axis.controller),
    }


def _law_values(controller: PidController | CascadeController | None) -> dict[str, float]:
    """Return the values of a control law; without one it is the axis' proportional one."""
    values = dict.fromkeys(("law_k_i", "law_k_d", "law_k_v", "law_filter", "law_u_0"), 0.0)
    values |= {"law": float(PROPORTIONAL), "law_k_p": 0.0, "law_v_max": inf, "law_samples": 1.0}
    values |= {"law_u_min": -inf, "law_u_max": inf, "windup": float(GOES_ON), "law_tracking": inf}
    if controller is None:
        return values
    lower, upper = controller.limits
    values |= {"law_k_p": controller.k_p, "law_k_i": controller.k_i, "law_u_0": controller.u_0}
    values |= {"law_u_min": lower, "law_u_max": upper, "windup": WINDUPS[controller.anti_windup]}
    values["law_tracking"] = controller.tracking_time or inf
    if isinstance(controller, PidController):
        return values | {
            "law": float(PID),
            "law_k_d": controller.k_d,
            "law_filter": controller.derivative_filter,
        }
    return values | {
        "law": float(CASCADE),
        "law_k_v": controller.k_v,
        "law_filter": controller.velocity_filter,
        "law_v_max": controller.v_max or inf,
    }


def kernel_parameters(
    axis: VirtualAxis, effects: Sequence[VirtualEffect] = (), dt: float = 1e-3
) -> Any:
    """Return a record of the axis' values, and ``effect_quantity`` of every effect, on or off.

    `dt` [s] is the step of the record, of which the sampling period of the controller is a
    multiple.

    Raises
    ------
    ModelError
        If two effects have one cause: the kernels know one form of each.
    """
    causes = [effect.form.cause for effect in effects]
    twice = sorted({cause for cause in causes if causes.count(cause) > 1})
    if twice:
        known = {"supply_droop", "valve_mismatch"} & set(twice)
        hint = " (a laboratory with that sensor or valve has one of its own)" if known else ""
        raise ModelError(
            f"{', '.join(twice)}: two effects of one cause; leave one of them out{hint}"
        )
    values = _axis_values(axis)
    if axis.controller is not None and axis.controller.sample_time is not None:
        values["law_samples"] = float(round(axis.controller.sample_time / dt))
    for form in ALL_FORMS.values():  # the usual form of a cause before its others
        own = {size.name: size.off for size in form.sizes} | dict(form.constants)
        for name, value in own.items():
            values.setdefault(f"{form.kernel}_{name}", value)
    for effect in effects:
        own = {**effect.parameters, **effect.form.constants}
        values |= {f"{effect.form.kernel}_{name}": value for name, value in own.items()}
    record = np.zeros(1, dtype=[(name, np.float64) for name in values])
    record[0] = tuple(float(value) for value in values.values())
    return record[0]
