"""`diagnosis.json` read back, with `curves.json` beside it: data only, nothing is executed."""

from dataclasses import replace
from pathlib import Path

from pneumo_casadi.diagnosis.locate.evidence import Evidence
from pneumo_casadi.diagnosis.result.diagnosis_result import Diagnosis
from pneumo_casadi.diagnosis.result.diagnosis_sections import DiagnosisSection
from pneumo_casadi.diagnosis.result.plain_evidence import evidence_of
from pneumo_casadi.diagnosis.result.plain_findings import FORMAT
from pneumo_casadi.errors import CaseError, PneumoError
from pneumo_casadi.runtime.json_input import check_format, read_json, typed

#: Names of the files of a diagnosis.
DIAGNOSIS, CURVES = "diagnosis.json", "curves.json"
_AGAIN = "diagnose the case again"


def read_diagnosis(path: str | Path) -> Diagnosis:
    """Return the diagnosis that `write_report` or ``pneumo-casadi diagnose`` has written.

    Parameters
    ----------
    path : path
        Folder of a diagnosis, or its ``diagnosis.json``.

    Returns
    -------
    Diagnosis
        With its curves where ``curves.json`` lies beside it, thinned to what a figure shows.

    Raises
    ------
    CaseError
        If there is no such file, or it is no complete diagnosis.

    Examples
    --------
    With ``diagnosis = pc.diagnose(pc.example_case())``:

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     report = pc.write_report(diagnosis, folder + "/report")
    ...     again = pc.diagnosis.read_diagnosis(report)
    >>> again.as_dict() == diagnosis.as_dict()
    True
    """
    path = Path(path)
    file = path / DIAGNOSIS if path.is_dir() else path
    content = read_json(file, f"name a folder that `diagnose` wrote, or its {DIAGNOSIS}")
    try:
        check_format(content, FORMAT)
        diagnosis = typed(content, DiagnosisSection).read
    except (PneumoError, ValueError) as error:
        raise CaseError(f"{file}: no complete diagnosis: {error}; {_AGAIN}") from None
    return replace(diagnosis, evidence=_evidence(file.parent / CURVES))


def _evidence(path: Path) -> Evidence | None:
    """Return the curves of a diagnosis; None where there is no such file."""
    if not path.exists():
        return None
    try:
        return evidence_of(read_json(path, _AGAIN))
    except (KeyError, TypeError, ValueError) as error:
        raise CaseError(
            f"{path}: no complete curves of a diagnosis ({type(error).__name__}: {error}); {_AGAIN}"
        ) from None
