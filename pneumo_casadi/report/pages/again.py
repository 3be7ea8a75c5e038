"""Reports written again from the result files of a folder alone."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from jinja2 import TemplateError

from pneumo_casadi.data.recording.curves import read_curves
from pneumo_casadi.diagnosis.result.read_diagnosis import DIAGNOSIS, read_diagnosis
from pneumo_casadi.errors import CaseError
from pneumo_casadi.identification.read_comparison import COMPARISON, read_comparison
from pneumo_casadi.identification.result_file import FORMAT
from pneumo_casadi.report.pages.comparison import comparison_html, overlays
from pneumo_casadi.report.pages.design import design_again
from pneumo_casadi.report.pages.diagnosis import diagnosis_html, drawn_pictures
from pneumo_casadi.report.pages.identification_again import (
    CAPTION,
    identification_again,
    time_pictures,
    validation_of,
)
from pneumo_casadi.report.pages.page import Picture
from pneumo_casadi.report.pages.validation import validation_html
from pneumo_casadi.report.text.final_model import FinalModel, final_model
from pneumo_casadi.runtime.json_input import check_format, read_json
from pneumo_casadi.runtime.output_folder import OutputKind, write_files

#: Names of the files of a report.
RESULT, DESIGN, CURVES = "result.json", "design.json", "curves.json"
REPORT = "report.html"
_ABSENT = "name a report folder of `identify`, `validate`, `diagnose`, `compare` or `design`"


def write_report_again(path: str | Path) -> Path:
    """Write ``report.html`` beside a result file, from the file and ``curves.json`` beside it.

    Parameters
    ----------
    path : path
        Report folder of ``identify``, ``validate``, ``diagnose``, ``compare`` or ``design``, or
        the file ``result.json``, ``diagnosis.json``, ``comparison.json`` or ``design.json`` of one.

    Returns
    -------
    Path
        The report. That of a diagnosis, a comparison or a validation is complete where there is a
        ``curves.json``, that of a design with ``design.png``. That of an identification has
        verdict, parameters, warnings, errors and provenance, and the time plots with
        ``curves.json``; its other figures need the records.

    Raises
    ------
    CaseError
        If there is no such result, or its folder holds another report.
    """
    file = _result_file(Path(path))
    content = read_json(file, _ABSENT)
    kind, page = _kind_of(content, file)
    try:
        html = page(content, file)
    except (KeyError, TypeError, AttributeError, ValueError, TemplateError) as error:
        raise CaseError(
            f"{file}: no complete result ({type(error).__name__}: {error}); {_REMEDIES[kind]}"
        ) from None
    (report,) = write_files({REPORT: html}, file.parent, kind)
    return report


def _result_file(path: Path) -> Path:
    """Return the result file of a folder: that of what the folder is a report of."""
    if not path.is_dir():
        return path
    # A diagnosis holds the result of its final model besides.
    there = [path / name for name in (DIAGNOSIS, COMPARISON, DESIGN) if (path / name).exists()]
    return there[0] if there else path / RESULT


def _kind_of(content: dict[str, Any], file: Path) -> tuple[OutputKind, "Page"]:
    """Return of which kind a result is, and what makes its page."""
    for key, (kind, page) in _PAGES.items():
        if key in content:
            return kind, page
    raise CaseError(
        f"{file}: no complete result: it has no {', '.join(map(repr, _PAGES))}; {_ABSENT}"
    )


def _identification(content: dict[str, Any], file: Path) -> str:
    check_format(content, FORMAT)
    return identification_again(
        content, read_curves(file.parent / CURVES, _REMEDIES[OutputKind.IDENTIFICATION])
    )


def _validation(content: dict[str, Any], file: Path) -> str:
    curves = read_curves(file.parent / CURVES, _REMEDIES[OutputKind.VALIDATION])
    return validation_html(validation_of(content), curves, time_pictures(curves, CAPTION))


def _diagnosis(content: dict[str, Any], file: Path) -> str:
    diagnosis = read_diagnosis(file)
    pictures = drawn_pictures(diagnosis)
    final = _refined(file.parent / RESULT)
    return diagnosis_html(diagnosis, pictures, final=final)


def _refined(path: Path) -> FinalModel | None:
    """Return the final model, where it was refined."""
    if not path.exists():
        return None
    content = read_json(path, "")
    check_format(content, FORMAT)
    return final_model(content)


def _comparison(content: dict[str, Any], file: Path) -> str:
    comparison = read_comparison(file)
    drawn = overlays(comparison)
    pictures = [Picture(each.name, each.png(), each.caption) for each in drawn]
    return comparison_html(comparison, pictures)


def _designed(content: dict[str, Any], file: Path) -> str:
    return design_again(content, file.parent)


Page = Callable[[dict[str, Any], Path], str]
#: What a result is, by a key that no other has, and what makes its page.
_PAGES: dict[str, tuple[OutputKind, Page]] = {
    "verdict": (OutputKind.DIAGNOSIS, _diagnosis),
    "differences": (OutputKind.COMPARISON, _comparison),
    "precision": (OutputKind.DESIGN, _designed),
    "output_error": (OutputKind.IDENTIFICATION, _identification),
    "validation": (OutputKind.VALIDATION, _validation),  # an identification has it besides
}
_REMEDIES = {
    OutputKind.DIAGNOSIS: "diagnose the case again",
    OutputKind.COMPARISON: "compare the results again",
    OutputKind.DESIGN: "design the experiment again",
    OutputKind.IDENTIFICATION: "identify the case again",
    OutputKind.VALIDATION: "validate the parameters again",
}
