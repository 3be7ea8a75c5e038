"""From a file of columns to a `Recording` in SI units."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from pneumo_casadi.data.bench.quantities import LENGTHS, PRESSURES
from pneumo_casadi.data.readers.tables import Table, read_table, suffix_of
from pneumo_casadi.data.recording.channels import UNITS, InputHold
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.errors import CaseError

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Column:
    """What a column of a file is: SI value = scale · value + offset.

    Parameters
    ----------
    channel : str
        Symbol of the channel, for example ``"p_P"``.
    scale, offset : float, optional
        Conversion to SI units.

    Examples
    --------
    >>> Column("p_P", scale=1e5, offset=1.013e5)  # bar, gauge -> Pa, absolute
    Column(channel='p_P', scale=100000.0, offset=101300.0)
    """

    channel: str
    scale: float = 1.0
    offset: float = 0.0


COLUMNS: Mapping[str, Column] = MappingProxyType(
    {f"{channel}_{unit}": Column(channel) for channel, unit in UNITS.items()}
)
"""Columns of a case folder: symbol and SI unit, as in ``p_P_Pa``."""

#: What a column of a file is taken for: a channel in SI units, a conversion, or several of them.
ColumnSpec = str | Column | Sequence[Column]

FOREIGN_UNITS = {"ms": (1e-3, 0.0), "us": (1e-6, 0.0), "mV": (1e-3, 0.0), **PRESSURES, **LENGTHS}


def read_recording(
    path: str | Path,
    hold: InputHold,
    columns: Mapping[str, ColumnSpec] | None = None,
    name: str | None = None,
) -> Recording:
    """Read one recording from CSV, gzipped CSV, MAT (7.3 with h5py) or Parquet.

    Parameters
    ----------
    path : str or Path
        File whose suffix names the format: .csv, .csv.gz, .mat, .parquet.
    hold : InputHold
        How the inputs ran between samples; no file tells, so state it.
    columns : mapping of str to (str, Column or sequence of Column), optional
        The file's own names -> channel, with a scale and offset where the unit is not SI;
        several where one column tells more than one channel. Columns named as in a case folder
        (``t_s``, ``p_P_Pa``, ...) need no entry. `column_map` writes it the other way round,
        with units by name. Vectors within structs of a MAT file go by ``log.p.A``.
    name : str, optional
        Name of the recording; by default the file's.

    Returns
    -------
    Recording
        Its channels are those of `columns` and of the case folder's naming; other columns are
        left out, with a log message.

    Raises
    ------
    CaseError
        If the file cannot be read, has no time, or its clock or a value is wrong.
    """
    path = Path(path)
    table = read_table(path, {*COLUMNS, *(columns or {})})
    meaning = _assign_columns(table, columns or {})
    channels = {
        column.channel: column.scale * table.columns[file_name] + column.offset
        for file_name, column in meaning
    }
    if "t" not in channels:
        raise CaseError(_no_column(table, "t"))
    t = channels.pop("t")
    stem = path.name[: len(path.name) - len(suffix_of(path))]
    return Recording(t, channels, name or stem, str(path), hold, table.first_line)


def _assign_columns(table: Table, columns: Mapping[str, ColumnSpec]) -> list[tuple[str, Column]]:
    for name in columns:
        if name not in table.columns:
            raise CaseError(
                f"{table.path}: no column `{name}`; the file has {', '.join(table.names)}"
            )
    meaning = [(name, column) for name, entry in columns.items() for column in _columns(entry)]
    taken = {column.channel for _, column in meaning}
    for name in table.names:
        if name in columns:
            continue
        if name in COLUMNS and COLUMNS[name].channel not in taken:
            meaning.append((name, COLUMNS[name]))
            continue
        _refuse_foreign_unit(table, name)
        log.info("%s: column `%s` is not used", table.path, name)
    found = [column.channel for _, column in meaning]
    twice = sorted({channel for channel in found if found.count(channel) > 1})
    if twice:
        raise CaseError(f"{table.path}: two columns for channel {', '.join(twice)}; name one")
    return meaning


def _columns(entry: ColumnSpec) -> Sequence[Column]:
    if isinstance(entry, str):
        return (Column(entry),)
    return (entry,) if isinstance(entry, Column) else entry


def _refuse_foreign_unit(table: Table, name: str) -> None:
    """Refuse a column such as ``p_P_bar``, which must not be passed over as unknown."""
    channel, _, unit = name.rpartition("_")
    if channel in UNITS and unit in FOREIGN_UNITS:
        scale, _ = FOREIGN_UNITS[unit]
        raise CaseError(
            f"{table.path}: column `{name}` is in {unit}, expected `{channel}_{UNITS[channel]}`; "
            f"convert it, or read it with columns={{'{name}': Column('{channel}', "
            f"scale={scale:g})}}"
        )


def _no_column(table: Table, channel: str) -> str:
    return (
        f"{table.path}: no column `{channel}_{UNITS[channel]}`; the file has "
        f"{', '.join(table.names)}; name the column, or pass columns={{...: '{channel}'}}"
    )
