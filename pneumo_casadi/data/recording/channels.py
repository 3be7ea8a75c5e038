"""Channels: their names and units, the hold of inputs, and checked, read-only arrays."""

from collections.abc import Callable, Mapping
from enum import Enum
from types import MappingProxyType

import numpy as np

from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray

#: No quantity is as large in any unit; squares and differences of smaller values stay finite.
LARGEST = 1e100

UNITS: Mapping[str, str] = MappingProxyType(
    {
        "t": "s",
        "u_P": "V",
        "u_N": "V",
        "p_P": "Pa",
        "p_N": "Pa",
        "x": "m",
        "x_ref": "m",
        "F": "N",
        "F_pulse": "N",
        "u": "V",
        "p_supply": "Pa",
        "v": "m/s",
        "a": "m/s2",
        "F_load": "N",
    }
)


def column_name(channel: str) -> str:
    """Return the column of a case folder that holds a channel.

    Examples
    --------
    >>> column_name("p_P"), column_name("a")
    ('p_P_Pa', 'a_m_per_s2')
    """
    return f"{channel}_{UNITS[channel].replace('/', '_per_')}"


class InputHold(Enum):
    """How the commands run between their samples.

    A supply pressure or a force on the rod that is measured always runs on linearly: held, it would
    act half a sample late.
    """

    ZERO = "zero order"
    """u(t) = u[k] for t[k] ≤ t < t[k+1], as a sampled controller holds it."""
    LINEAR = "linear"
    """u(t) runs straight from u[k] to u[k+1], as a measured, continuous signal does."""


def checked(
    channel: str, values: object, rows: int | None, source: str, where: Callable[[int], str]
) -> FloatArray:
    """Return a read-only copy of a channel.

    Raises
    ------
    CaseError
        If it is no vector of `rows` values, or a value is not finite or beyond `LARGEST`.
    """
    array = np.array(values, dtype=float)
    if array.ndim != 1 or (rows is not None and array.size != rows):
        raise CaseError(
            f"{source}: `{channel}` has shape {array.shape}, expected "
            f"({'N' if rows is None else rows},); give one value a time stamp"
        )
    wrong = np.flatnonzero(~(np.abs(array) < LARGEST))
    if wrong.size:
        raise CaseError(
            f"{where(int(wrong[0]))}: `{channel}` [{UNITS.get(channel, 'SI')}] is "
            f"{array[wrong[0]]} ({wrong.size} of {array.size} rows); cut these rows out or "
            "repair the sensor"
        )
    return read_only(array)


def read_only(array: FloatArray) -> FloatArray:
    """Make the array read-only and return it."""
    array.flags.writeable = False
    return array
