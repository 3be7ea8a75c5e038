"""Files of columns: CSV, CSV.gz, MAT and Parquet read into arrays, or an error with its row."""

import gzip
import io
import re
import zlib
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pneumo_casadi.data.readers.mat import read_mat
from pneumo_casadi.errors import CaseError, MissingExtraError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.input_files import (
    decoded,
    one_line,
    printable,
    read_bytes,
    shown,
)

SUFFIXES = (".csv", ".csv.gz", ".mat", ".parquet")
CSV_FIRST_LINE = 2  # the header stands in line 1
#: Largest file, packed or unpacked [bytes]: an hour of a servo axis at 5 kHz as text.
LARGEST = 2**30
#: Noisy numbers are packed to a tenth; a small file may unpack to `SMALL` bytes all the same.
RATIO, SMALL = 100, 64 * 2**20
#: Most columns of a table: loggers write some dozens.
MOST_COLUMNS = 10_000
#: Most rows of a binary table: an hour at 5 kHz.
MOST_ROWS = 20_000_000


@dataclass(frozen=True, slots=True)
class Table:
    """Columns of equal length as a file holds them.

    Parameters
    ----------
    path : Path
        The file.
    columns : mapping of str to (N,) array
        The requested columns, by the file's own names; an empty cell is NaN.
    names : tuple of str
        All columns of numbers that the file has; of a CSV file, all columns.
    first_line : int
        Line in which the first row stands; 0 where the format has no lines.
    """

    path: Path
    columns: Mapping[str, FloatArray]
    names: tuple[str, ...]
    first_line: int


def suffix_of(path: Path) -> str:
    """Return the suffix that names the format, ``.csv.gz`` included."""
    return next((suffix for suffix in SUFFIXES if path.name.lower().endswith(suffix)), "")


def read_table(path: Path, wanted: Collection[str]) -> Table:
    """Read some columns of a file, in the format that its suffix names.

    Parameters
    ----------
    path : Path
        The file.
    wanted : collection of str
        Names of the columns to read; other columns need not be numbers.

    Raises
    ------
    CaseError
        If the file is missing, empty, truncated or of another format, or a cell is not a number.
    """
    suffix = suffix_of(path)
    if not suffix:
        raise CaseError(f"{path}: unknown suffix {path.suffix!r}; use one of {', '.join(SUFFIXES)}")
    content = read_bytes(path, "check the name and the folder", LARGEST)
    if not content:
        raise CaseError(f"{path}: the file is empty (0 bytes); copy or export it again")
    if suffix == ".mat":
        columns, names = read_mat(path, content, wanted)
        table = Table(path, columns, names, 0)
    elif suffix == ".parquet":
        table = _read_parquet(path, content, wanted)
    else:
        table = _read_csv(path, _text(path, content), wanted)
    if any(not values.size for values in table.columns.values()):
        raise CaseError(f"{path}: the file has no rows of data; copy or export it again")
    return table


def _read_csv(path: Path, text: bytes, wanted: Collection[str]) -> Table:
    header = _header(path, text)
    _check_ending(path, text)
    text = text.rstrip(b"\r\n") + b"\n"  # empty lines at the end are no rows
    options: dict[str, Any] = {
        "names": header,
        "header": 0,
        "index_col": False,
        "skip_blank_lines": False,
        "encoding": "utf-8",
    }
    try:
        # All columns are read, as with usecols pandas passes over rows that are too long.
        types = {name: np.float64 if name in wanted else str for name in header}
        frame = pd.read_csv(io.BytesIO(text), dtype=types, **options)
    except pd.errors.ParserError as error:
        raise _bad_row(path, header, error) from None
    except (ValueError, OverflowError) as error:
        raise _bad_cell(path, text, options, wanted) or CaseError(
            f"{path}: {one_line(error)}"
        ) from None
    columns = {name: frame[name].to_numpy() for name in header if name in wanted}
    _check_last_row(path, columns)
    return Table(path, columns, tuple(header), CSV_FIRST_LINE)


def _text(path: Path, content: bytes) -> bytes:
    """Return the text of a CSV file as UTF-8 with lines that end in line feeds."""
    if path.name.lower().endswith(".gz"):
        content = _unpacked(path, content)
    text = decoded(content, path)
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text.encode()


def _unpacked(path: Path, content: bytes) -> bytes:
    most = min(LARGEST, max(SMALL, RATIO * len(content)))
    try:
        with gzip.open(io.BytesIO(content)) as stream:
            unpacked = stream.read(most + 1)
    except (EOFError, OSError, zlib.error) as error:  # a bad header is an OSError
        raise CaseError(
            f"{path}: the compressed file is cut short or damaged ({one_line(error)}); "
            "copy or export it again"
        ) from None
    if len(unpacked) > most:
        raise CaseError(
            f"{path}: {len(content)} bytes unpack to more than {most} bytes, which no recording "
            "does; export it again"
        )
    return unpacked


def _header(path: Path, text: bytes) -> list[str]:
    line = text.split(b"\n", 1)[0].decode()
    if not line.strip(" ,\r"):
        raise CaseError(f"{path}: line 1 is empty; it must name the columns")
    if "," not in line and (";" in line or "\t" in line):
        raise CaseError(
            f"{path}: line 1 separates columns by semicolon or tab; use commas between columns "
            "and a point in numbers"
        )
    first_row = next(iter(text.split(b"\n", 2)[1:2]), b"")
    # Commas in quotes part no cells.
    more = b'"' not in first_row and first_row.count(b",") > line.count(",")
    remark = "," not in line and line.lstrip().startswith(("#", "%"))
    if remark or (more and not any(map(_is_number, first_row.decode().split(",")))):
        raise CaseError(
            f"{path}: line 1, {shown(line.strip()[:60])}, does not name the columns; delete the "
            "lines before the one that does, and any other comments"
        )
    if more:
        raise CaseError(
            f"{path}: row 1 (line 2) has more cells than line 1 names columns; use commas between "
            "columns only, and a point in numbers"
        )
    names = [name.strip().strip('"') for name in line.strip().split(",")]
    if len(names) > MOST_COLUMNS:
        raise CaseError(
            f"{path}: line 1 names {len(names)} columns, more than the {MOST_COLUMNS} that are read"
            "; is the file transposed?"
        )
    _check_unique(path, names)
    return names


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _check_unique(path: Path, names: Sequence[str]) -> None:
    twice = sorted(name for name, count in Counter(names).items() if count > 1)
    if twice:
        first = ", ".join(printable(name[:60]) for name in twice[:5])
        raise CaseError(f"{path}: line 1 names column {first} twice; remove one")


def _bad_row(path: Path, header: list[str], error: Exception) -> CaseError:
    match = re.search(r"in line (\d+), saw (\d+)", str(error))
    if not match:
        return CaseError(f"{path}: {one_line(error)}; export it again")
    line, cells = (int(group) for group in match.groups())
    return CaseError(
        f"{path}: row {line - CSV_FIRST_LINE + 1} (line {line}) has {cells} cells, line 1 names "
        f"{len(header)} columns; correct the row"
    )


def _check_ending(path: Path, text: bytes) -> None:
    """Refuse a last number that was cut short: it would pass for another number."""
    if text.endswith(b"\n"):
        return
    lines = text[-4096:].split(b"\n")[1:]
    if not lines:  # a header alone
        return
    *before, last = (line.rpartition(b".")[2] for line in lines)
    decimals = {len(cell.rstrip(b"\r")) for cell in before}
    if len(before) > 2 and len(decimals) == 1 and len(last) < decimals.pop():
        raise CaseError(
            f"{path}: line {text.count(bytes([10])) + 1}, the last one, ends in {last.decode()!r} "
            "with fewer decimals than all before: the file is cut short; copy or export it again"
        )


def _bad_cell(
    path: Path, text: bytes, options: dict[str, Any], wanted: Collection[str]
) -> CaseError | None:
    """Return an error for the first cell that is not a number; slow, used after a failure only."""
    frame = pd.read_csv(io.BytesIO(text), dtype=str, keep_default_na=False, **options)
    frame = frame[[name for name in frame if name in wanted]]
    numbers = frame.apply(pd.to_numeric, errors="coerce")
    wrong = numbers.isna() & ~frame.isin(["", "nan", "NaN", "NA"])
    rows = np.flatnonzero(wrong.any(axis=1).to_numpy())
    if not rows.size:
        return None
    row = int(rows[0])
    column = str(frame.columns[int(wrong.iloc[row].to_numpy().argmax())])
    cell = frame[column].iloc[row]
    return CaseError(
        f"{path}: row {row + 1} (line {row + CSV_FIRST_LINE}), column `{printable(column[:60])}`: "
        f"{shown(cell)} is no number; write plain numbers with a decimal point"
    )


def _check_last_row(path: Path, columns: Mapping[str, FloatArray]) -> None:
    for name, values in list(columns.items())[-1:]:
        if values.size and np.isnan(values[-1]) and not np.isnan(values[:-1]).any():
            raise CaseError(
                f"{path}: row {values.size} (line {values.size + CSV_FIRST_LINE - 1}), the last "
                f"one, ends before column `{name}`: the file is cut short; copy or export it again"
            )


def _read_parquet(path: Path, content: bytes, wanted: Collection[str]) -> Table:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise MissingExtraError(
            f"{path}: reading Parquet needs pyarrow, which is not installed: "
            "pip install 'pneumo-casadi[parquet]'; or export the file as CSV"
        ) from error
    try:
        file = pyarrow.parquet.ParquetFile(pyarrow.BufferReader(content))
        if file.metadata.num_rows > MOST_ROWS:
            raise CaseError(
                f"{path}: {file.metadata.num_rows} rows, more than the {MOST_ROWS} that are read; "
                "export less into one file"
            )
        numbers = [
            field.name
            for field in file.schema_arrow
            if pyarrow.types.is_floating(field.type) or pyarrow.types.is_integer(field.type)
        ]
        _check_unique(path, numbers)
        table = file.read([name for name in numbers if name in wanted])
    except CaseError:
        raise
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise CaseError(
            f"{path}: not a readable Parquet file ({one_line(error)}); export it again"
        ) from None
    columns = {
        name: np.array(table.column(name).to_numpy(), dtype=float) for name in table.column_names
    }
    return Table(path, columns, tuple(numbers), 0)
