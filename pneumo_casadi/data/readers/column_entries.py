"""Entries of ``columns.json`` that correct how a channel is read."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pneumo_casadi.data.readers.columns import Column, ColumnSpec
from pneumo_casadi.data.readers.units import SI_FACTORS
from pneumo_casadi.data.recording.channels import UNITS, column_name

NEAR = 0.2
"""Share by which an ambient pressure differs from the standard one: up to 2000 m above the sea."""


@dataclass(frozen=True, slots=True)
class ColumnEntries:
    """The columns from which the channels of a case are read now.

    Parameters
    ----------
    columns : mapping, optional
        The file's own names -> channels, as `read_columns` returns it; channels that it does not
        name are read from the column of a case folder's own naming.
    one_command : bool, optional
        Whether both commands come from the one of a 5/3 valve.

    Examples
    --------
    >>> entries = ColumnEntries({"pA": (Column("p_P", 1e5),)})
    >>> entries.corrected("p_P", offset=1e5)
    {'p_P_Pa': {'column': 'pA', 'unit': 'bar', 'offset': 100000}}
    >>> entries.corrected("p_P", taken_from="p_N")
    {'p_P_Pa': 'p_N_Pa'}
    >>> ColumnEntries(one_command=True).corrected("u_P", rows_late=1)
    {'u_V': {'column': 'u_V', 'rows_late': 1}}
    """

    columns: Mapping[str, ColumnSpec] = field(default_factory=dict)
    one_command: bool = False

    def corrected(
        self,
        channel: str,
        *,
        taken_from: str | None = None,
        factor: float = 1.0,
        offset: float = 0.0,
        rows_late: int = 0,
    ) -> dict[str, Any]:
        """Return the entry of a channel that is read otherwise than now.

        Parameters
        ----------
        channel : str
            Symbol of the channel.
        taken_from : str, optional
            Channel whose column holds it; by default its own.
        factor, offset : float, optional
            Correct value = factor · value as read now + offset [SI].
        rows_late : int, optional
            Rows by which the column is late.
        """
        if self._from_one_command(channel):
            if channel == "u_N":
                return {}  # it follows from the one command, as u_P does
            channel, taken_from, factor = "u", None, -factor if taken_from else factor
        name, column = self._read_from(taken_from or channel)
        if not self.offset_in_own_unit(taken_from or channel, offset):
            offset += factor * column.offset
        scale = factor * column.scale
        late = column.rows_late + rows_late
        units = {size: unit for unit, size in SI_FACTORS.get(UNITS[channel], {}).items()}
        entry: dict[str, Any] = {"column": name}
        if scale in units:
            entry |= {} if scale == 1.0 else {"unit": units[scale]}
        else:
            entry["scale"] = _short(scale)
        entry |= {"offset": _short(offset)} if offset else {}
        entry |= {"rows_late": late} if late else {}
        return {column_name(channel): name if len(entry) == 1 else entry}

    def offset_in_own_unit(self, channel: str, expected: float) -> tuple[float, float] | None:
        """Return the offset of a channel [SI], and that meant if it is in the column's own unit.

        It is if it comes as near to the expected one, of either sign, as that of the day is known.

        Parameters
        ----------
        channel : str
            Symbol of the channel.
        expected : float
            Offset that it may have been meant for [SI].
        """
        _, column = self._read_from(channel)
        meant = abs(column.scale) * column.offset

        def near(offset: float) -> bool:
            return abs(abs(offset) - abs(expected)) < NEAR * abs(expected)

        return (column.offset, meant) if near(meant) and not near(column.offset) else None

    def _from_one_command(self, channel: str) -> bool:
        named = {c.channel for spec in self.columns.values() for c in _as_columns(spec)}
        return channel in ("u_P", "u_N") and self.one_command and not {"u_P", "u_N"} & named

    def _read_from(self, channel: str) -> tuple[str, Column]:
        for name, spec in self.columns.items():
            for column in _as_columns(spec):
                if column.channel == channel:
                    return name, column
        return column_name(channel), Column(channel)


def _as_columns(spec: ColumnSpec) -> Sequence[Column]:
    if isinstance(spec, str):
        return (Column(spec),)
    return (spec,) if isinstance(spec, Column) else spec


def _short(value: float) -> float:
    """Return a number without digits that are rounding, whole where it is."""
    rounded = float(f"{value:.10g}")
    return int(rounded) if rounded.is_integer() else rounded
