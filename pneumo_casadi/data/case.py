"""A case: the bench, recordings and flow map of one axis."""

from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from pneumo_casadi.data.bench.driven_bench import AnyBench
from pneumo_casadi.data.checks.finding import Finding
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.errors import CaseError
from pneumo_casadi.runtime.input_files import printable
from pneumo_casadi.runtime.presentation import Presentable


@dataclass(frozen=True, slots=True, repr=False)
class Case(Presentable):
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
        File of the measured static flow map of the valve; `pneumo_casadi.valve.read_flow_map` reads
        it.
    findings : tuple of Finding
        What the checks report of data that were accepted, the gravest first.
    flow_map_N_path : Path, optional
        File of the map of chamber N's valve where the two valves differ; `flow_map_path` is then
        that of chamber P's.

    Raises
    ------
    CaseError
        If there is no record to identify on.

    Examples
    --------
    >>> import pneumo_casadi as pc
    >>> case = pc.example_case()
    >>> case.to_frame()["duration_s"].round(1).to_dict()
    {'identify': 10.0, 'validate': 8.0}
    """

    folder: Path
    bench: AnyBench
    identify: tuple[Recording, ...]
    validate: tuple[Recording, ...] = ()
    flow_map_path: Path | None = None
    findings: tuple[Finding, ...] = ()
    flow_map_N_path: Path | None = None

    def __post_init__(self) -> None:
        if not self.identify:
            raise CaseError(f"{self.folder}: no record to identify on; add identify.csv.gz")

    @property
    def name(self) -> str:
        """Name of the folder."""
        return printable(self.folder.name)

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that it was read from, in order; those that are no longer there are left out."""
        records = {Path(record.source) for record in (*self.identify, *self.validate)}
        candidates = {self.folder / "bench.json", self.folder / "columns.json", *records}
        candidates |= {path for path in (self.flow_map_path, self.flow_map_N_path) if path}
        return tuple(sorted(path for path in candidates if path.is_file()))

    @property
    def headline(self) -> str:
        """Name, kind of axis, whether its valve was measured, and the gravest finding."""
        mapped = "no flow map" if self.flow_map_path is None else f"{self.flow_map_path.name}"
        count = f", {len(self.findings)} findings, the first: " if self.findings else ""
        first = f"{count}{self.findings[0].grade}: {self.findings[0].text}" if count else ""
        return f"Case {self.name}: {type(self.bench).__name__}, {mapped}{first}"

    def to_frame(self) -> pd.DataFrame:
        """Return one row a record: what it is for, its length and its channels."""
        rows = [
            {
                "record": record.name,
                "use": use,
                "duration_s": record.duration,
                "rows": record.N,
                "rate_Hz": 1 / record.dt,
                "channels": " ".join(record.names),
            }
            for use, records in (("identify", self.identify), ("validate", self.validate))
            for record in records
        ]
        return pd.DataFrame(rows).set_index("record")
