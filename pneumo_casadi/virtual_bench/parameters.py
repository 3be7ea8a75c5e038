"""The parameters of a run as one record that the kernels read by name."""

from collections.abc import Sequence
from math import pi
from typing import Any

import numpy as np

from pneumo_casadi.virtual_bench.axis import VirtualAxis
from pneumo_casadi.virtual_bench.catalogue import FORMS
from pneumo_casadi.virtual_bench.effect import VirtualEffect


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
    }


def kernel_parameters(axis: VirtualAxis, effects: Sequence[VirtualEffect] = ()) -> Any:
    """Return a record of the axis' values, and ``effect_quantity`` of every effect, on or off."""
    values = _axis_values(axis)
    for form in FORMS.values():
        values |= {f"{form.name}_{size.name}": size.off for size in form.sizes}
    for effect in effects:
        values |= {f"{effect.name}_{name}": value for name, value in effect.parameters.items()}
    record = np.zeros(1, dtype=[(name, np.float64) for name in values])
    record[0] = tuple(float(value) for value in values.values())
    return record[0]
