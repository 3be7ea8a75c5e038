"""Operating points that an axis can have: within its stroke, its commands and its pressures."""

from collections.abc import Mapping

import numpy as np

from pneumo_casadi.data import Bench
from pneumo_casadi.data.checks.ranges import largest_command
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.validity.physical_range import require_physical_start
from pneumo_casadi.parameters import FloatArray

#: Rounding of a value in a file, relative to its limit.
ROUNDING = 1e-3


def require_in_range(axis: Axis, values: Mapping[str, float]) -> None:
    """Refuse a position beyond the stroke, or commands that the valve does not get.

    Commands end at the controller's largest one, or, where the bench states none, at those at
    which the flow map was metered: beyond them it is not known.

    Raises
    ------
    ModelError
        Naming the value, its unit and the limits.
    """
    bench = axis.bench
    if not isinstance(bench, Bench):  # its position counts from anywhere
        return
    limits = {"x": (*bench.stroke_limits, "m", "the stroke")}
    largest = largest_command(bench.controller)
    metered = getattr(axis.flow, "u_range", None)
    if largest is not None:
        commands = (-largest, largest, "V", "`controller.u_max`")
        limits |= dict.fromkeys(axis.kind.commands, commands)
    elif metered is not None:
        commands = (*metered, "V", "the flow map")
        limits |= dict.fromkeys(axis.kind.commands, commands)
    for name, (lower, upper, unit, source) in limits.items():
        margin = ROUNDING * (upper - lower)
        if name in values and not lower - margin <= values[name] <= upper + margin:
            raise ModelError(
                f"operating point: {name} = {values[name]:g} {unit} lies outside {source}, "
                f"{lower:g} to {upper:g} {unit}; give a point within it"
            )


def require_possible(axis: Axis, x: FloatArray, u: FloatArray) -> None:
    """Refuse an operating point that the axis cannot have, states `x` and inputs `u`.

    Raises
    ------
    ModelError
        Naming the value, its unit and what it may be.
    """
    names = (*axis.states, *axis.inputs)
    require_in_range(axis, dict(zip(names, np.concatenate([x, u]).tolist(), strict=True)))
    require_physical_start(axis.kind, axis.parameters, axis.constants, x, "operating point")
