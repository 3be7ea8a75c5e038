"""`comparison.json` read back, with `curves.json` beside it: data only, nothing is executed."""

from math import inf
from pathlib import Path
from typing import Any

import msgspec

from pneumo_casadi.data.recording.curves import read_curves
from pneumo_casadi.errors import CaseError
from pneumo_casadi.identification.compared_model import Estimate
from pneumo_casadi.identification.comparison import Comparison, CrossSimulation, Difference
from pneumo_casadi.runtime.json_input import Section, read_json, typed
from pneumo_casadi.validation import Error

#: Names of the files of a comparison.
COMPARISON, CURVES = "comparison.json", "curves.json"
_AGAIN = "compare the results again"


class EstimateSection(Section):
    """An estimate; `std` is null where there is no interval."""

    value: float
    std: float | None
    unit: str

    @property
    def read(self) -> Estimate:
        """The estimate."""
        return Estimate(self.value, inf if self.std is None else self.std, self.unit)


class DifferenceSection(Section):
    """A parameter in two results; the change from zero is null."""

    name: str
    other: str
    change_percent: float | None
    sigmas: float | None

    @property
    def read(self) -> Difference:
        """The difference."""
        change = inf if self.change_percent is None else self.change_percent
        return Difference(self.name, self.other, change, self.sigmas)


class ErrorSection(Section):
    """Error of a simulation."""

    unit: str
    rms: float
    percent: float
    noise_percent: float


class CrossSection(Section):
    """Errors of one result's parameters on another's records."""

    parameters: str
    records: str
    errors: dict[str, ErrorSection]

    @property
    def read(self) -> CrossSimulation:
        """The errors."""
        errors = {
            name: Error(item.unit, item.rms, item.percent, item.noise_percent)
            for name, item in self.errors.items()
        }
        return CrossSimulation(self.parameters, self.records, errors)


class ComparisonSection(Section):
    """What is read of a `comparison.json`."""

    results: tuple[str, ...]
    parameters: dict[str, dict[str, EstimateSection | None]]
    differences: tuple[DifferenceSection, ...]
    simulations: tuple[CrossSection, ...]
    notes: tuple[str, ...]
    provenance: dict[str, Any] = msgspec.field(default_factory=dict)


def read_comparison(path: str | Path) -> Comparison:
    """Return the comparison that `write_report` or ``pneumo-casadi compare`` has written.

    Parameters
    ----------
    path : path
        Folder of a comparison, or its ``comparison.json``.

    Returns
    -------
    Comparison
        With the records over time where ``curves.json`` lies beside it.

    Raises
    ------
    CaseError
        If there is no such file, or it is no complete comparison.

    Examples
    --------
    With ``comparison = pc.compare(result, result)``, an identification compared with itself:

    >>> import tempfile
    >>> from pneumo_casadi.identification.read_comparison import read_comparison
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     report = pc.write_report(comparison, folder + "/report")
    ...     again = read_comparison(report)
    >>> again.as_dict() == comparison.as_dict()
    True
    """
    path = Path(path)
    file = path / COMPARISON if path.is_dir() else path
    content = read_json(file, f"name a folder that `compare` wrote, or its {COMPARISON}")
    try:
        read = typed(content, ComparisonSection)
        estimates = {name: _row(read, name) for name in read.parameters}
    except CaseError as error:
        raise CaseError(f"{file}: no complete comparison: {error}; {_AGAIN}") from None
    return Comparison(
        read.results,
        estimates,
        tuple(item.read for item in read.differences),
        tuple(item.read for item in read.simulations),
        read.notes,
        read_curves(file.parent / CURVES, _AGAIN),
        read.provenance,
    )


def _row(read: ComparisonSection, name: str) -> tuple[Estimate | None, ...]:
    """Return the estimates of a parameter in the order of the results."""
    row = read.parameters[name]
    if set(row) != set(read.results) or not any(row.values()):
        raise CaseError(f"`parameters.{name}`: expected an estimate of {', '.join(read.results)}")
    items = (row[label] for label in read.results)
    return tuple(None if item is None else item.read for item in items)
