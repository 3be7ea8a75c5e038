"""A diagnosis as one HTML file and as a folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pneumo_casadi.diagnosis import Diagnosis, Verdict
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.report.figures.style import png, svg
from pneumo_casadi.report.pages.diagnosis_figures import diagnosis_figures
from pneumo_casadi.report.pages.identification import Picture, page
from pneumo_casadi.report.pages.write import Kind, folder_in_one_step
from pneumo_casadi.report.tables.diagnosis import (
    between,
    chance,
    check_table,
    fitted_table,
    gap_table,
    percent,
    plain,
    ranking_table,
    regime_table,
    whole,
)
from pneumo_casadi.report.tables.flow_form import flow_form_tables
from pneumo_casadi.report.tables.results import Table
from pneumo_casadi.report.text.diagnosis import (
    VERDICTS,
    Catalogue,
    alternative_sentences,
    cause_sentences,
    check_sentences,
    headline,
    place,
    size_sentences,
    size_title,
    summary_text,
    where_sentences,
)
from pneumo_casadi.runtime.json_files import write_json

#: Colour of the bar beside a verdict; the words say the same.
_COLOURS = {Verdict.NONE: "#009E73", Verdict.EFFECT: "#0072B2"}
_OTHER = "#D55E00"


@dataclass(frozen=True, slots=True)
class _Section:
    anchor: str
    title: str
    sentences: Sequence[str] = ()
    pictures: Sequence[Picture] = ()
    tables: Sequence[Table] = ()
    checks: Sequence[tuple[bool, str]] = ()

    @property
    def empty(self) -> bool:
        return not (
            self.sentences or self.pictures or self.checks or any(t.rows for t in self.tables)
        )


def diagnosis_html(
    found: Diagnosis,
    pictures: Sequence[Picture],
    catalogue: Catalogue = EFFECTS,
    provenance: Mapping[str, Any] | None = None,
) -> str:
    """Return a diagnosis as one HTML page that requests nothing.

    Parameters
    ----------
    found : Diagnosis
        What was found.
    pictures : sequence of Picture
        Its figures.
    catalogue : mapping of str to effect class, optional
        Where the effects are described.
    provenance : mapping, optional
        ``versions``, ``sha256`` and ``options``.
    """
    sections = [one for one in _sections(found, pictures, catalogue) if not one.empty]
    return page(
        "diagnosis.html.jinja",
        found=found,
        verdict=VERDICTS[found.verdict],
        colour=_COLOURS.get(found.verdict, _OTHER),
        headline=headline(found),
        facts=_facts(found),
        sections=sections,
        provenance=provenance or {},
    )


def _sections(
    found: Diagnosis, pictures: Sequence[Picture], catalogue: Catalogue
) -> list[_Section]:
    def drawn(*starts: str) -> list[Picture]:
        return [one for one in pictures if one.name.startswith(starts)]

    return [
        _Section(
            "where", "Where", where_sentences(found, catalogue), drawn("where", "unknown_inputs"),
            [regime_table(found)],
        ),
        _Section(
            "which", "Which effect", cause_sentences(found, catalogue), drawn("ranking"),
            [ranking_table(found)],
        ),
        _Section(
            "size", size_title(found), size_sentences(found), drawn("gap"),
            [gap_table(found)],
        ),
        _Section("else", "What else it could be", alternative_sentences(found, catalogue)),
        _Section("shape", "Residuals over what went on", pictures=drawn("regimes")),
        _Section(
            "checks", "Parameters against geometry and data sheet",
            checks=check_sentences(found), tables=[check_table(found)],
        ),
        _Section("parameters", "Parameters", tables=[fitted_table(found)]),
        _Section("flow_form", "Flow map", tables=flow_form_tables(found.flow_selection)),
        _Section("notes", "Notes", found.notes),
    ]  # fmt: skip


def _facts(found: Diagnosis) -> list[tuple[str, str]]:
    gap, closure = found.gap, found.gap.closure
    facts = [("Where", place(found))]
    facts += [
        (
            "Cause" if one is found.effects[0] else "and",
            f"{plain(one.name)}, probability {chance(one.probability)}",
        )
        for one in found.effects
    ]
    if found.effects:
        facts += [
            ("Error on held-out data", f"{percent(gap.before)} → {percent(gap.after)}"),
            ("Closed", f"{whole(closure.value)} ({between(closure)})"),
        ]
    else:
        facts.append(("Error on held-out data", percent(gap.before)))
    wrong = sum(not one.agrees for one in found.checks)
    if found.checks:
        facts.append(("Checks of parameters", f"{wrong} of {len(found.checks)} contradict"))
    return facts


def write_diagnosis(
    found: Diagnosis,
    folder: str | Path,
    catalogue: Catalogue = EFFECTS,
    provenance: Mapping[str, Any] | None = None,
) -> Path:
    """Write a diagnosis into a folder.

    Parameters
    ----------
    found : Diagnosis
        What was found.
    folder : path
        Folder to make. One that holds an earlier diagnosis is replaced as a whole.
    catalogue : mapping of str to effect class, optional
        Where the effects are described.
    provenance : mapping, optional
        ``versions``, ``sha256`` and ``options``.

    Returns
    -------
    Path
        The folder: ``diagnosis.json``, ``report.html``, ``summary.txt``, ``figures`` as PNG and
        SVG.

    Raises
    ------
    CaseError
        If the folder holds anything but an earlier diagnosis.
    """
    known = {"provenance": dict(provenance)} if provenance else {}
    with folder_in_one_step(folder, Kind.DIAGNOSIS) as draft:
        write_json(found.as_dict() | known, draft / "diagnosis.json")
        (draft / "summary.txt").write_text(summary_text(found, catalogue), "utf-8")
        (draft / "figures").mkdir()
        pictures = []
        for drawn in diagnosis_figures(found):
            picture = Picture(drawn.name, svg(drawn.figure), drawn.caption)
            (draft / "figures" / f"{drawn.name}.png").write_bytes(png(drawn.figure))
            (draft / "figures" / f"{drawn.name}.svg").write_bytes(picture.content)
            pictures.append(picture)
        html = diagnosis_html(found, pictures, catalogue, provenance)
        (draft / "report.html").write_text(html, "utf-8")
    return Path(folder)
