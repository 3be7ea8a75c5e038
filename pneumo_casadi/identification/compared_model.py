"""One of the results that are compared: estimates, model and records, from wherever they come."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pneumo_casadi.data import Case, Recording, read_case
from pneumo_casadi.errors import CaseError, PneumoError
from pneumo_casadi.identification.identify import identify
from pneumo_casadi.identification.model_file import axis_of_section
from pneumo_casadi.identification.read_result import (
    EstimateSection,
    ResultSection,
    read_result,
    result_path,
)
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.identification.result_file import HELD, result_dict
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.runtime.json_input import typed
from pneumo_casadi.runtime.progress import Progress
from pneumo_casadi.runtime.provenance import sha256

#: Derived quantities that are compared beside the parameters.
DERIVED = ("k_P", "k_N")


@dataclass(frozen=True, slots=True)
class Estimate:
    """An estimate with its robust standard deviation.

    Parameters
    ----------
    value, std : float
        In `unit`; `std` is 0 where the parameter was held, infinite where there is no interval.
    unit : str
        SI unit.
    """

    value: float
    std: float
    unit: str


@dataclass(frozen=True, eq=False)
class ComparedModel:
    """An identified model with the records to simulate.

    Parameters
    ----------
    name : str
        Of its folder or case.
    estimates : mapping of str to Estimate
        Parameters of axis and effects, k_P and k_N.
    axis : Axis or None
        None where the file holds no model.
    records : tuple of Recording
        Held-out records, or those of the fit where there are none; empty where the case is gone.
    held_out : bool
        Whether `records` were held out.
    sources : mapping of str to str
        Hashes of the data, by file name.
    note : str
        Why there are no records, or empty.
    """

    name: str
    estimates: Mapping[str, Estimate]
    axis: Axis | None
    records: tuple[Recording, ...]
    held_out: bool
    sources: Mapping[str, str]
    note: str = ""


def compared_model(
    source: Identification | Case | str | Path, progress: Progress | None = None
) -> ComparedModel:
    """Return the model of a result, its file or folder; a case is identified first.

    Raises
    ------
    CaseError
        If a path is neither a result nor a case.
    FitError
        If a case cannot be identified.
    """
    if isinstance(source, Case):
        source = identify(source, progress=progress)
    if isinstance(source, Identification):
        content = typed(result_dict(source), ResultSection)
        return _of_content(source.case.name, content, source.axis, source.case, source.case.folder)
    path = Path(source)
    file = result_path(path)
    if path.is_dir() and not file.is_file():
        return compared_model(read_case(path), progress)
    content = read_result(file)
    name = path.name if path.is_dir() else path.resolve().parent.name
    try:
        axis = None if content.model is None else axis_of_section(content.model)
    except CaseError as error:
        raise CaseError(f"{file}: {error}") from None
    case, note = _case_of(content)
    return _of_content(name, content, axis, case, file, note)


def _of_content(
    name: str,
    content: ResultSection,
    axis: Axis | None,
    case: Case | None,
    path: Path,
    note: str = "",
) -> ComparedModel:
    fit = content.output_error
    items = fit.parameters | {n: fit.derived[n] for n in DERIVED if n in fit.derived}
    if not items:
        raise CaseError(f"{path}: holds no estimates")
    records: tuple[Recording, ...] = ()
    if case is not None:
        records = case.validate or case.identify
    return ComparedModel(
        name,
        {key: _estimate(item) for key, item in items.items()},
        axis,
        records,
        case is not None and bool(case.validate),
        content.provenance.sha256,
        note,
    )


def _estimate(item: EstimateSection) -> Estimate:
    if item.note == HELD:
        std = 0.0
    else:
        std = max((std for std in (item.std, item.std_robust) if std is not None), default=math.inf)
    return Estimate(item.value, std, item.unit)


def _case_of(content: ResultSection) -> tuple[Case | None, str]:
    """Return the case of a result where it is still as it was, or None and why not."""
    folder = content.folder
    if folder is None:  # files of 0.1 do not name it
        return None, "the result does not name its case folder"
    try:
        case = read_case(folder)
    except (PneumoError, OSError) as error:
        return None, str(error)
    known = content.provenance.sha256  # records made in memory have no file, and no hash
    files = [path for path in case.files if path.name in known]
    changed = [path.name for path in files if sha256(path) != known[path.name]]
    if changed:
        return None, f"{folder}: {', '.join(changed)} changed since the identification"
    return case, ""
