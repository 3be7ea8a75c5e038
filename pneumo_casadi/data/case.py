"""A case: the bench, recordings and flow map of one axis."""

from dataclasses import dataclass
from pathlib import Path

from pneumo_casadi.data.bench.bench import AnyBench
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

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that it was read from, in order; those that are no longer there are left out."""
        records = {Path(record.source) for record in (*self.identify, *self.validate)}
        candidates = {self.folder / "bench.json", self.folder / "columns.json", *records}
        if self.flow_map_path is not None:
            candidates.add(self.flow_map_path)
        return tuple(sorted(path for path in candidates if path.is_file()))
