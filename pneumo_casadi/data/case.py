"""A case: the folder that holds a bench, its recordings and its flow map."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pneumo_casadi.data.bench.bench import AnyBench
from pneumo_casadi.data.bench.bench_file import read_bench
from pneumo_casadi.data.checks.records import check_recording
from pneumo_casadi.data.readers.column_map import COLUMNS_FILE, read_columns
from pneumo_casadi.data.readers.records import ColumnSpec, read_recording
from pneumo_casadi.data.readers.tables import suffix_of
from pneumo_casadi.data.recording.channels import InputHold
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.errors import CaseError


@dataclass(frozen=True, slots=True)
class Case:
    """All that was measured on one axis.

    Parameters
    ----------
    folder : Path
        Where it was read from.
    bench : Bench or ForceBench
        The axis.
    identify : tuple of Recording
        Records to fit to, one or more.
    validate : tuple of Recording
        Records held out from every fit; may be empty.
    flow_map_path : Path, optional
        Measured static flow map of the valve, to be read by the flow package.
    notes : tuple of str
        What the checks noticed but do not hold against the data.

    Raises
    ------
    CaseError
        If there is no record to identify on.
    """

    folder: Path
    bench: AnyBench
    identify: tuple[Recording, ...]
    validate: tuple[Recording, ...] = ()
    flow_map_path: Path | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.identify:
            raise CaseError(f"{self.folder}: no record to identify on; add identify.csv.gz")

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.folder.name


def load_case(
    folder: str | Path,
    check: bool = True,
    hold: InputHold = InputHold.ZERO,
    columns: Mapping[str, ColumnSpec] | None = None,
) -> Case:
    """Load a case folder.

    It holds ``bench.json``, one or more records ``identify*`` and any number of records
    ``validate*`` (.csv, .csv.gz, .mat, .parquet; in the order of their names), and
    ``flow_map.csv`` where the valve was metered.

    Parameters
    ----------
    folder : str or Path
        The case folder.
    check : bool, optional
        Whether to hold the records against the bench (`check_recording`).
    hold : InputHold, optional
        A case folder's inputs are held at zero order unless you know better.
    columns : mapping, optional
        Names and units of columns that are not those of a case folder; see `read_recording`.
        By default those that ``columns.json`` tells, where the folder holds one; see
        `read_columns`.

    Raises
    ------
    CaseError
        If something is missing, cannot be read, or contradicts the bench.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise CaseError(f"{folder}: no such folder; give the folder that holds bench.json")
    bench = read_bench(folder / "bench.json")
    if columns is None and (folder / COLUMNS_FILE).is_file():
        columns = read_columns(folder / COLUMNS_FILE)
    records = {
        role: tuple(read_recording(path, hold, columns) for path in _record_files(folder, role))
        for role in ("identify", "validate")
    }
    notes: list[str] = []
    if check:
        for recording in (*records["identify"], *records["validate"]):
            notes.extend(check_recording(recording, bench))
    flow_map = folder / "flow_map.csv"
    return Case(
        folder,
        bench,
        records["identify"],
        records["validate"],
        flow_map if flow_map.is_file() else None,
        tuple(notes),
    )


def _record_files(folder: Path, role: str) -> list[Path]:
    files = sorted(path for path in folder.glob(f"{role}*") if suffix_of(path))
    stems = [path.name.removesuffix(suffix_of(path)) for path in files]
    twice = sorted({stem for stem in stems if stems.count(stem) > 1})
    if twice:
        raise CaseError(
            f"{folder}: record {', '.join(twice)} stands there in two formats; keep one of them"
        )
    return files
