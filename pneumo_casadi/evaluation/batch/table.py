"""Tables of many diagnoses: one row for each case."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pandas as pd

from pneumo_casadi.runtime.atomic_files import atomic_file
from pneumo_casadi.runtime.input_files import printable

#: Names of the tables within the output folder.
CSV, PARQUET = "cases.csv", "cases.parquet"
#: The verdict of a row whose case ended in an error.
FAILED = "failed"


@dataclass(frozen=True, slots=True)
class Row:
    """One row of the tables.

    Parameters
    ----------
    case : str
        Name of its folder.
    verdict : str
        A `Verdict` by its value, or ``failed``.
    effects : tuple of str
        Found, the one that is missed most first.
    probabilities : tuple of float
        That each of them is part of the cause.
    alike : tuple of str
        What the data cannot tell apart.
    where : str
        Balance in which model and measurement disagree; empty where the case failed.
    gap_before_percent, gap_after_percent : float or None
        Held-out gap without and with the effects, in per cent of the signals.
    shrink, shrink_lower, shrink_upper : float or None
        How far it closes, 1 - after/before, with its interval.
    seconds : float or None
        That the diagnosis took.
    error : str
        Why there is none; empty where there is one.
    """

    case: str
    verdict: str
    effects: tuple[str, ...] = ()
    probabilities: tuple[float, ...] = ()
    alike: tuple[str, ...] = ()
    where: str = ""
    gap_before_percent: float | None = None
    gap_after_percent: float | None = None
    shrink: float | None = None
    shrink_lower: float | None = None
    shrink_upper: float | None = None
    seconds: float | None = None
    error: str = ""


def row_of(record: Mapping[str, Any]) -> Row:
    """Return the row of a record; KeyError or TypeError if it is none."""
    case, seconds, diagnosis = record["case"], record["seconds"], record["diagnosis"]
    if diagnosis is None:
        return Row(case, FAILED, seconds=seconds, error=record["error"])
    gap, effects = diagnosis["gap"], diagnosis["effects"]
    lower, upper = gap["shrink_interval"]
    return Row(
        case=case,
        verdict=diagnosis["verdict"],
        effects=tuple(effect["name"] for effect in effects),
        probabilities=tuple(effect["probability"] for effect in effects),
        alike=tuple(diagnosis["ambiguous"]),
        where=diagnosis["where"]["balance"],
        gap_before_percent=gap["before"],
        gap_after_percent=gap["after"],
        shrink=gap["shrink"],
        shrink_lower=lower,
        shrink_upper=upper,
        seconds=seconds,
    )


def write_tables(rows: Sequence[Row], out: Path) -> None:
    """Write ``cases.csv`` into a folder, and ``cases.parquet`` where pyarrow is installed.

    Each file is written whole or not at all. Both have the same columns; in the CSV the items of
    a list are joined by plus signs.

    Parameters
    ----------
    rows : sequence of Row
        One a case, in the order in which they are to stand.
    out : Path
        The folder; it is made if it is not there.
    """
    frame = pd.DataFrame([asdict(row) for row in rows])
    for name in _LISTS:
        frame[name] = [" + ".join(_written(item) for item in value) for value in frame[name]]
    for name in (*_TEXTS, *_LISTS):
        frame[name] = [as_cell(text) for text in frame[name]]
    with atomic_file(out / CSV) as draft:
        frame.to_csv(draft, index=False, float_format="%.10g", lineterminator="\n")
    if find_spec("pyarrow") is not None:
        _write_parquet(rows, out / PARQUET)
    else:  # one of an earlier run would contradict the CSV
        (out / PARQUET).unlink(missing_ok=True)


def as_cell(text: str) -> str:
    r"""Return text that a spreadsheet shows, and does not take for a formula.

    Examples
    --------
    >>> as_cell("axis 2"), as_cell('=HYPERLINK("http://")')
    ('axis 2', '\'=HYPERLINK("http://")')
    """
    text = printable(text)
    return f"'{text}" if text.lstrip().startswith(("=", "+", "-", "@")) else text


def _write_parquet(rows: Sequence[Row], path: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    text, number = pyarrow.string(), pyarrow.float64()
    types = {
        "effects": pyarrow.list_(text),
        "probabilities": pyarrow.list_(number),
        "alike": pyarrow.list_(text),
    } | dict.fromkeys(_TEXTS, text)
    schema = pyarrow.schema([(field.name, types.get(field.name, number)) for field in fields(Row)])
    table = pyarrow.Table.from_pylist([asdict(row) for row in rows], schema=schema)
    with atomic_file(path) as draft:
        pyarrow.parquet.write_table(table, draft)


_TEXTS = ("case", "verdict", "where", "error")
_LISTS = ("effects", "probabilities", "alike")


def _written(item: str | float) -> str:
    return item if isinstance(item, str) else f"{item:.6g}"
