"""A recording from a file of columns: the columns are named, and converted to SI units."""

import logging
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pneumo_casadi.data.readers.columns import COLUMNS, COLUMNS_FILE, Column, ColumnSpec
from pneumo_casadi.data.readers.tables import Table, read_table, suffix_of
from pneumo_casadi.data.readers.units import SI_FACTORS
from pneumo_casadi.data.recording.channels import UNITS, InputHold, column_name
from pneumo_casadi.data.recording.clock import Clock, split_rows
from pneumo_casadi.data.recording.parts import spread_of_delays
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.errors import CaseError
from pneumo_casadi.runtime.input_files import listed, printable

#: Rows below which a record has nothing to teach.
FEWEST_ROWS = 50

WITHOUT_CLOCK = (
    "; if no time was recorded and the clock was uniform, add a column t_s = row / sampling "
    "frequency (lost rows then do not show)"
)

log = logging.getLogger(__name__)


def read_recording(
    path: str | Path,
    hold: InputHold,
    columns: Mapping[str, ColumnSpec] | None = None,
    name: str | None = None,
    clock: Clock = Clock.UNIFORM,
) -> Recording:
    """Read one recording from CSV, gzipped CSV, MAT (7.3 with h5py) or Parquet.

    Parameters
    ----------
    path : str or Path
        File whose suffix names the format: .csv, .csv.gz, .mat, .parquet.
    hold : InputHold
        How the commands ran between samples; files do not state it.
    columns : mapping of str to (str, Column or sequence of Column), optional
        The file's own names -> channel, with a scale and offset where the unit is not SI;
        several where one column serves more than one channel. Columns named as in a case folder
        (``t_s``, ``p_P_Pa``, ...) need no entry. `column_map` writes it the other way round,
        with units by name. Vectors within structs of a MAT file go by ``log.p.A``.
    name : str, optional
        Name of the recording; by default the file's.
    clock : Clock, optional
        Whether the time stamps are those of a uniform clock.

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
    table = read_table(Path(path), {*COLUMNS, *(columns or {})})
    return recording_of_table(table, hold, columns, name, clock)


def recording_of_table(
    table: Table,
    hold: InputHold,
    columns: Mapping[str, ColumnSpec] | None = None,
    name: str | None = None,
    clock: Clock = Clock.UNIFORM,
) -> Recording:
    """Return the recording that a table holds; arguments and errors as in `read_recording`."""
    meaning = _assign_columns(table, columns or {})
    recording, late = _as_filed(table, hold, meaning, name, clock)
    return recording.aligned(late) if late else recording


@dataclass(frozen=True, slots=True)
class FileContent:
    """What a file of a case holds.

    Parameters
    ----------
    stretches : tuple of Recording
        One for each stretch between gaps.
    one_command : bool
        Whether the commands of both chambers are read from the one column of a 5/3 valve.
    """

    stretches: tuple[Recording, ...]
    one_command: bool


def read_stretches(
    path: str | Path,
    hold: InputHold,
    columns: Mapping[str, ColumnSpec] | None = None,
    clock: Clock = Clock.UNIFORM,
) -> FileContent:
    """Read a file as `read_recording` does, and split it where the clock has gaps.

    Late columns are aligned within each stretch: the last rows before a gap have no later value.
    """
    table = read_table(Path(path), {*COLUMNS, *(columns or {})})
    meaning = _assign_columns(table, columns or {})
    recording, late = _as_filed(table, hold, meaning, None, clock)
    stretches: tuple[Recording, ...] = (recording,)
    if clock is Clock.AS_RECORDED:
        stretches = split_at_gaps(recording, FEWEST_ROWS + spread_of_delays(late))
    if late:
        stretches = tuple(part.aligned(late) for part in stretches)
    return FileContent(stretches, "u" in {column.channel for _, column in meaning})


def _as_filed(
    table: Table,
    hold: InputHold,
    meaning: Sequence[tuple[str, Column]],
    name: str | None,
    clock: Clock,
) -> tuple[Recording, dict[str, int]]:
    """Return what a table holds row by row, and the rows by which channels are late in it."""
    path = table.path
    channels = {
        column.channel: column.to_si(table.columns[file_name]) for file_name, column in meaning
    }
    if "t" not in channels:
        raise CaseError(_no_column(table, "t"))
    t = channels.pop("t")
    if "u" in channels:  # one 5/3 valve: filling one chamber empties the other
        u = channels.pop("u")
        channels = {"u_P": u, "u_N": -u} | channels
    stem = printable(path.name[: len(path.name) - len(suffix_of(path))])
    source = str(path)
    recording = Recording(t, channels, name or stem, source, hold, table.first_line, clock=clock)
    late = {column.channel: column.rows_late for _, column in meaning if column.rows_late}
    if "u" in late:
        late |= dict.fromkeys(("u_P", "u_N"), late.pop("u"))
    return recording, late


def split_at_gaps(recording: Recording, fewest: int = FEWEST_ROWS) -> tuple[Recording, ...]:
    """Return the stretches between gaps of a recording whose clock is taken as recorded.

    Stretches of fewer than `fewest` rows are left out, with a log message.

    Raises
    ------
    CaseError
        If no stretch is long enough.
    """
    parts = recording.split_at(split_rows(recording.t))
    kept = tuple(part for part in parts if fewest <= part.N)
    if not kept:
        raise CaseError(
            f"{recording.source}: gaps leave no stretch of {fewest} rows; record with a "
            "steadier clock"
        )
    if len(kept) < len(parts):
        log.info("%s: %d short stretches are not used", recording.source, len(parts) - len(kept))
    return kept


def _assign_columns(table: Table, columns: Mapping[str, ColumnSpec]) -> list[tuple[str, Column]]:
    for name in columns:
        if name not in table.columns:
            raise CaseError(
                f"{table.path}: no column `{name}`; the file has {listed(table.names)}; correct "
                f"{COLUMNS_FILE}"
            )
    meaning = [(name, column) for name, entry in columns.items() for column in _as_columns(entry)]
    taken = {column.channel for _, column in meaning}
    if {"u_P", "u_N"} <= taken:
        taken.add("u")  # which would be both of them
    for name in table.names:
        if name in COLUMNS and COLUMNS[name].channel not in taken:
            replaced = _own_columns(table, columns.get(name))
            if replaced:
                raise CaseError(
                    f"{table.path}: {COLUMNS_FILE} gives `{name}` for {', '.join(replaced)} too, "
                    "which the file has; leave out one of the columns"
                )
            meaning.append((name, COLUMNS[name]))  # it serves another channel besides its own
            continue
        if name in columns:
            continue
        _refuse_foreign_unit(table, name)
        log.info("%s: column `%s` is not used", table.path, name)
    channels = [column.channel for _, column in meaning]
    if "u" in channels:
        channels += ["u_P", "u_N"]
    twice = sorted(channel for channel, count in Counter(channels).items() if count > 1)
    if twice:
        raise CaseError(f"{table.path}: two columns for channel {', '.join(twice)}; name one")
    return meaning


def _own_columns(table: Table, entry: ColumnSpec | None) -> list[str]:
    """Return the columns of a file whose channels an entry takes from another column."""
    channels = {column.channel for column in _as_columns(entry)} if entry else set()
    return [name for name in table.names if name in COLUMNS and COLUMNS[name].channel in channels]


def _as_columns(entry: ColumnSpec) -> Sequence[Column]:
    if isinstance(entry, str):
        return (Column(entry),)
    return (entry,) if isinstance(entry, Column) else entry


def _refuse_foreign_unit(table: Table, name: str) -> None:
    """Refuse a column such as ``p_P_bar``, which would otherwise be ignored as unknown."""
    channel, _, unit = name.rpartition("_")
    factors = SI_FACTORS[UNITS[channel]] if channel in UNITS else {}
    if unit in factors and unit != UNITS[channel]:
        ours = column_name(channel)
        raise CaseError(
            f"{table.path}: column `{name}` is in {unit}, expected `{ours}`; convert it, or write "
            f'in {COLUMNS_FILE}: "{ours}": ["{name}", "{unit}"]'
        )


def _no_column(table: Table, channel: str) -> str:
    return (
        f"{table.path}: no column `{column_name(channel)}`; the file has "
        f"{listed(table.names)}; write in {COLUMNS_FILE} which of them it is, as "
        f'"{column_name(channel)}": "NAME"' + (WITHOUT_CLOCK if channel == "t" else "")
    )
