"""States that an axis can have: chambers with a volume, pressures of a gas."""

from collections.abc import Mapping

import numpy as np

from pneumo_casadi.data import AxisKind
from pneumo_casadi.data.bench.axis_kind import UNITS
from pneumo_casadi.errors import ModelError
from pneumo_casadi.parameters import FloatArray, Parameters

#: Share of the ambient pressure below which an initial pressure has another unit: a chamber that
#: was open to the exhaust and is closed would have to expand to ten times its volume.
LEAST_START = 0.1


def position_limits(kind: AxisKind, parameters: Parameters) -> tuple[float, float]:
    """Return the positions at which a chamber has no volume [m], infinite without chambers.

    Eq. 3 with the parameters of eq. 10 and 11: V_P is zero at -X_s1/X_s2 and V_N at X_s4/X_s5.
    """
    if not kind.gas_chambers:
        return -np.inf, np.inf
    X = {name: parameters[name].value for name in ("X_s1", "X_s2", "X_s4", "X_s5")}
    return -X["X_s1"] / X["X_s2"], X["X_s4"] / X["X_s5"]


def require_physical_start(
    kind: AxisKind,
    parameters: Parameters,
    constants: Mapping[str, float],
    x_0: FloatArray,
    name_of_x_0: str = "x_0",
) -> None:
    """Refuse an initial state without chamber volumes or with pressures that no gas has.

    Raises
    ------
    ModelError
        Naming the state, its value and unit.
    """
    for name, value in zip(kind.states, x_0.tolist(), strict=False):
        if not np.isfinite(value):
            raise ModelError(
                f"{name_of_x_0}: {name} = {value} {UNITS[name]}; give finite numbers, SI units"
            )
        if UNITS[name] == "Pa" and value < LEAST_START * constants["p_ext"]:
            raise ModelError(
                f"{name_of_x_0}: {name} = {value:g} Pa, far below the ambient pressure "
                f"{constants['p_ext']:g} Pa; give absolute pressures in Pa, not in bar or gauge"
            )
    empty = _without_volume(kind, parameters, x_0[: len(kind.states), None])
    if empty is not None:
        raise ModelError(f"{name_of_x_0}: {empty[1]}; give the position in m from mid-stroke")


def require_physical(
    kind: AxisKind,
    parameters: Parameters,
    t: FloatArray,
    x: FloatArray,
    u: FloatArray,
    run: str = "the simulation",
) -> None:
    """Refuse a simulation in which a chamber loses its volume, or a pressure is not positive.

    Beyond such a sample all numbers are without meaning, even if they are finite.

    Parameters
    ----------
    kind : AxisKind
        Names states and inputs.
    parameters : Parameters
        Give the volumes of the chambers.
    t : (N,) array
        Time [s].
    x, u : (nx, N), (nu, N) arrays
        States, those of the nominal axis first, and inputs.
    run : str
        What the message calls the simulation.

    Raises
    ------
    ModelError
        Naming the first such sample, the quantity, its value and unit, and the remedy.
    """
    reasons = []
    empty = _without_volume(kind, parameters, x)
    if empty is not None:
        remedy = "keep the piston within its stroke by other inputs or references, or end earlier"
        reasons.append((*empty, remedy))
    for names, values, remedy in (
        (kind.states, x, "give a shorter dt, or inputs and parameters that an axis can have"),
        (kind.inputs, u, "give absolute pressures in Pa"),
    ):
        for name, row in zip(names, values, strict=False):
            low = np.flatnonzero(row <= 0.0) if UNITS[name] == "Pa" else np.zeros(0, dtype=int)
            if low.size:
                text = f"{name} = {row[low[0]]:g} Pa, which no gas has"
                reasons.append((int(low[0]), text, remedy))
    if reasons:
        k, text, remedy = min(reasons, key=lambda reason: reason[0])
        raise ModelError(f"{run} at t = {t[k]:g} s (sample {k}): {text}; {remedy}")


def _without_volume(
    kind: AxisKind, parameters: Parameters, x: FloatArray
) -> tuple[int, str] | None:
    """Return the first sample at which a chamber has no volume, and what is wrong there."""
    lower, upper = position_limits(kind, parameters)
    position = x[kind.states.index("x")]
    outside = np.flatnonzero((position <= lower) | (position >= upper))
    if not outside.size:
        return None
    k = int(outside[0])
    chamber = "P" if position[k] <= lower else "N"
    return k, (
        f"x = {position[k]:g} m, where chamber {chamber} has no volume: both have one between "
        f"{lower:.4g} m (-X_s1/X_s2) and {upper:.4g} m (X_s4/X_s5)"
    )
