"""The report of any result."""

from pathlib import Path

from pneumo_casadi.design import Design
from pneumo_casadi.diagnosis import Diagnosis
from pneumo_casadi.errors import ModelError
from pneumo_casadi.identification.comparison import Comparison
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.report.pages.design import write_design
from pneumo_casadi.report.pages.diagnosis import write_diagnosis
from pneumo_casadi.report.pages.write import (
    write_comparison,
    write_identification,
    write_validation,
)
from pneumo_casadi.validation import Validation


def write_report(
    result: Identification | Diagnosis | Design | Validation | Comparison, folder: str | Path
) -> Path:
    """Write the report of a result into a folder.

    Parameters
    ----------
    result : Identification, Diagnosis, Design, Validation or Comparison
        What to report.
    folder : path
        Folder to make. One that holds an earlier report of the same kind is replaced;
        what you added to it stays.

    Returns
    -------
    Path
        The folder. An identification gives ``report.html``, ``result.json``, ``curves.json``,
        ``table.txt`` and ``figures``; a diagnosis ``report.html``, ``diagnosis.json``,
        ``curves.json``, ``summary.txt`` and ``figures``; a design ``report.html``,
        ``reference.csv``, ``design.json``, ``design.txt`` and its figure; a validation
        ``report.html``, ``result.json``, ``curves.json``, ``table.txt`` and ``figures``; a
        comparison ``comparison.json``, ``comparison.txt``, ``curves.json``, ``report.html`` and
        ``figures``.

    Raises
    ------
    CaseError
        If the folder holds anything but an unchanged earlier report of this kind.
    ModelError
        If the result is of another type.

    Examples
    --------
    With ``result = pc.identify(pc.example_case())``, the report of its validation alone:

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     report = pc.write_report(result.validation, folder + "/report")
    ...     sorted(path.name for path in report.iterdir() if path.name[0] != ".")
    ['curves.json', 'figures', 'report.html', 'result.json', 'table.txt']
    """
    if isinstance(result, Identification):
        return write_identification(result, folder)
    if isinstance(result, Diagnosis):
        return write_diagnosis(result, folder)
    if isinstance(result, Design):
        return write_design(result, folder)
    if isinstance(result, Validation):
        return write_validation(result, folder)
    if isinstance(result, Comparison):
        return write_comparison(result, folder)
    raise ModelError(
        f"no report of a {type(result).__name__}; there is one of an Identification, a Diagnosis, "
        "a Design, a Validation and a Comparison"
    )
