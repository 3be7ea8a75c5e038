"""From a column of a file to a channel in SI units: its name, unit, scale and offset.

The conversion of a column stands in ``columns.json`` of a case folder (`read_columns`), or is given
as a mapping (`column_map`); `Column.to_si` applies it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pneumo_casadi.data.readers.units import SI_FACTORS
from pneumo_casadi.data.recording.channels import UNITS, column_name
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.input_files import printable, shown
from pneumo_casadi.runtime.json_input import ClosedSection, read_json, typed

COLUMNS_FILE = "columns.json"


@dataclass(frozen=True, slots=True)
class Column:
    """The channel that a column of a file holds, and its conversion to SI units.

    Parameters
    ----------
    channel : str
        Symbol of the channel, for example ``"p_P"``.
    scale, offset : float, optional
        SI value = scale · value + offset.
    rows_late : int, optional
        Rows by which the column is late: row k of the file belongs to the time of row
        k − rows_late.

    Examples
    --------
    >>> import numpy as np
    >>> gauge_bar = Column("p_P", scale=1e5, offset=1.013e5)  # to absolute Pa
    >>> float(gauge_bar.to_si(np.array([6.0]))[0])
    701300.0
    """

    channel: str
    scale: float = 1.0
    offset: float = 0.0
    rows_late: int = 0

    def to_si(self, values: FloatArray) -> FloatArray:
        """Return the values of the column in SI units, for example bar as Pa."""
        return self.scale * values + self.offset


COLUMNS: Mapping[str, Column] = MappingProxyType(
    {column_name(channel): Column(channel) for channel in UNITS}
)
"""Columns of a case folder: symbol and SI unit, as in ``p_P_Pa``."""

#: A channel whose unit is SI already, a channel with its conversion, or several of these.
ColumnSpec = str | Column | Sequence[Column]


class _Entry(ClosedSection):
    """Where a channel comes from."""

    column: str
    unit: str | None = None
    scale: float | None = None
    offset: float = 0.0
    rows_late: int = 0


def column_map(entries: Mapping[str, Any]) -> dict[str, tuple[Column, ...]]:
    """Return the `columns` of `read_recording` from what a case folder would call them.

    Parameters
    ----------
    entries : mapping of str to object
        Column of a case folder (``t_s``, ``p_P_Pa``, ...) -> where it comes from: the file's own
        name (SI unit), ``(name, unit)``, or ``{"column": name, "unit": unit, "offset": number}``
        with ``"scale"`` in place of ``"unit"`` where the unit is your own. The offset, in SI
        units, is added last: ambient pressure to a gauge pressure, half the stroke to a position
        counted from one end. ``"rows_late"``: rows by which the column is late.

    Returns
    -------
    dict of str to tuple of Column
        By the file's own names; one of them may serve several channels.

    Raises
    ------
    CaseError
        If a column is unknown, a unit does not fit its channel, or a value is not a number.

    Examples
    --------
    >>> column_map({"t_s": "time", "p_P_Pa": ("log.pA", "bar")})["log.pA"]
    (Column(channel='p_P', scale=100000.0, offset=0.0, rows_late=0),)
    >>> one_command = column_map({"u_P_V": "u", "u_N_V": {"column": "u", "scale": -1}})
    >>> [column.channel for column in one_command["u"]]
    ['u_P', 'u_N']
    """
    columns: dict[str, tuple[Column, ...]] = {}
    for ours, entry in entries.items():
        if ours not in COLUMNS:
            raise CaseError(
                f"`{printable(str(ours)[:60])}` is no column of a case folder; known are "
                f"{', '.join(COLUMNS)}"
            )
        theirs, column = _column(ours, entry)
        columns[theirs] = (*columns.get(theirs, ()), column)
    return columns


def read_columns(path: str | Path) -> dict[str, tuple[Column, ...]]:
    """Read ``columns.json``, which is `column_map` as a file.

    For example::

        {"t_s": "log.time", "p_P_Pa": ["log.pA", "bar"], "p_N_Pa": ["log.pB", "bar"],
         "x_m": {"column": "log.pos", "unit": "mm", "offset": -0.25}}

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    dict of str to tuple of Column
        As `column_map` returns it, for `read_recording`.

    Raises
    ------
    CaseError
        If the file is no JSON object, or an entry is wrong; see `column_map`.
    """
    path = Path(path)
    content = read_json(path, 'write one as {"t_s": "time"}')
    try:
        return column_map(content)
    except CaseError as error:
        raise CaseError(f"{path}: {error}") from None


def _column(ours: str, entry: Any) -> tuple[str, Column]:
    parts: Any = entry
    if isinstance(entry, str):
        parts = {"column": entry}
    elif isinstance(entry, list | tuple) and len(entry) == 2:
        column, unit = typed(entry, tuple[str, str], ours)
        parts = {"column": column, "unit": unit}
    elif not isinstance(entry, Mapping):
        raise CaseError(
            f"`{ours}`: expected a name, [name, unit] or an object of "
            f"{', '.join(_Entry.__struct_fields__)}, got {shown(entry)}; write one of them"
        )
    given = typed(parts, _Entry, ours)
    if given.unit is not None and given.scale is not None:
        raise CaseError(f"`{ours}`: unit and scale say the same twice; leave one out")
    channel = COLUMNS[ours].channel
    scale = 1.0 if given.scale is None else given.scale
    if given.unit is not None:
        units = SI_FACTORS[UNITS[channel]]
        if given.unit not in units:
            raise CaseError(
                f"`{ours}`: unit {shown(given.unit)} of variable `{printable(given.column)}` is "
                f"unknown; known are {', '.join(units)}, for another give a scale to "
                f"{UNITS[channel]}"
            )
        scale = units[given.unit]
    if not 0 < abs(scale) < math.inf or not math.isfinite(given.offset):
        raise CaseError(
            f"`{ours}`: scale {scale:g}, offset {given.offset:g}; give finite numbers to "
            f"{UNITS[channel]}, and a scale other than 0"
        )
    if channel == "t" and given.rows_late:
        raise CaseError(f"`{ours}`: rows_late {given.rows_late}; shift another channel than t")
    return given.column, Column(channel, scale, given.offset, given.rows_late)
