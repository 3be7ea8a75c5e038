"""A diagnosis as one HTML file and as a folder."""

import json
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING

from pneumo_casadi.diagnosis import Diagnosis, Verdict
from pneumo_casadi.diagnosis.refined_identification import with_refined_checks
from pneumo_casadi.diagnosis.result.plain_evidence import evidence_dict
from pneumo_casadi.diagnosis.result.read_diagnosis import CURVES
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.effects.term import write_term
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.report.pages import page
from pneumo_casadi.report.pages.drawing import can_draw
from pneumo_casadi.report.pages.page import (
    TIME_FIGURE,
    Picture,
    Plot,
    Section,
    html_page,
    plots_of,
)
from pneumo_casadi.report.pages.write import save_figures
from pneumo_casadi.report.tables.diagnosis import (
    gap_table,
    ranking_table,
    regime_table,
)
from pneumo_casadi.report.tables.flow_form import flow_form_tables
from pneumo_casadi.report.tables.laboratory import legend_table
from pneumo_casadi.report.tables.table import Table
from pneumo_casadi.report.tables.validation import records_table
from pneumo_casadi.report.tables.verdict.estimates import diagnosis_tables, fitted_table
from pneumo_casadi.report.tables.verdict.parameter_checks import check_table
from pneumo_casadi.report.text.causes import (
    Catalogue,
    cause_sentences,
    discovered_sentences,
)
from pneumo_casadi.report.text.diagnosis import (
    FINDINGS_TITLE,
    VERDICTS,
    alternative_sentences,
    finding_sentences,
    headline,
    note_sentences,
    refused_sentences,
    size_sentences,
    size_title,
    summary_text,
    where_sentences,
)
from pneumo_casadi.report.text.facts import facts
from pneumo_casadi.report.text.final_model import (
    FinalModel,
    final_model,
    final_sentences,
    final_title,
)
from pneumo_casadi.report.text.parameter_checks import check_sentences, checks_of_what
from pneumo_casadi.runtime.json_files import write_json
from pneumo_casadi.runtime.output_folder import OutputKind, output_folder

if TYPE_CHECKING:
    from pneumo_casadi.report.pages.identification_figures import Drawn

#: Grades of verdicts, which give the colour; the words say the same.
_GRADES = {Verdict.NONE: "good", Verdict.EFFECT: "effect"}


def diagnosis_html(
    diagnosis: Diagnosis,
    pictures: Sequence[Picture],
    catalogue: Catalogue = EFFECTS,
    final: FinalModel | None = None,
) -> str:
    """Return a diagnosis as one HTML page that requests nothing.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    pictures : sequence of Picture
        Its figures.
    catalogue : mapping of str to effect class, optional
        Where the effects are described.
    final : FinalModel, optional
        The final model refined by output error.
    """
    simulations = () if diagnosis.evidence is None else diagnosis.evidence.simulations
    plots, left = plots_of(simulations, pictures)
    words = VERDICTS[diagnosis.verdict]
    answer = page.Verdict(
        _GRADES.get(diagnosis.verdict, "care"),
        words[:1].upper() + words[1:],
        headline(diagnosis),
        facts(diagnosis, final),
    )
    sections = _sections(diagnosis, left, catalogue, final)
    sections.insert(1, _simulated(plots, left))
    seconds = f"Computing time: {diagnosis.seconds:.0f} s."
    origin = diagnosis.provenance
    sections.append(
        Section(
            "provenance", "Provenance", (seconds,), tables=[records_table(origin)],
            provenance=origin,
        )
    )  # fmt: skip
    return html_page(f"Diagnosis of {diagnosis.case}", answer, sections)


def _simulated(plots: Sequence[Plot], pictures: Sequence[Picture]) -> Section:
    """Return the section with the outputs over time."""
    still = [picture for picture in pictures if picture.name.startswith(TIME_FIGURE)]
    return Section("simulation", "Measurement and simulation", pictures=still, plots=plots)


def _sections(
    diagnosis: Diagnosis,
    pictures: Sequence[Picture],
    catalogue: Catalogue,
    final: FinalModel | None,
) -> list[Section]:
    def drawn(*starts: str) -> list[Picture]:
        return [picture for picture in pictures if picture.name.startswith(starts)]

    values = None if final is None else final.values
    return [
        Section("findings", FINDINGS_TITLE, finding_sentences(diagnosis)),
        Section(
            "where", "Where model and measurement disagree", where_sentences(diagnosis, catalogue),
            drawn("where", "unknown_inputs"), [regime_table(diagnosis)],
        ),
        Section(
            "discovered", "Discovered term", discovered_sentences(diagnosis),
            drawn("discovered_term"),
        ),
        Section(
            "which", "Candidate causes",
            (*cause_sentences(diagnosis, catalogue, values), *refused_sentences(diagnosis)),
            drawn("ranking"),
            [ranking_table(diagnosis)],
        ),
        Section(
            "size", size_title(diagnosis), size_sentences(diagnosis), drawn("gap"),
            [gap_table(diagnosis)],
        ),
        Section(
            "final", final_title(diagnosis), final_sentences(diagnosis, final),
            tables=() if final is None else final.tables,
        ),
        Section("else", "Other possible causes", alternative_sentences(diagnosis, catalogue)),
        Section("shape", "Residuals over the operating conditions", pictures=drawn("regimes")),
        Section(
            "checks", "Parameters compared with geometry and data sheet",
            checks_of_what(diagnosis), tables=[check_table(diagnosis)],
            checks=check_sentences(diagnosis),
        ),
        Section(
            "parameters", "Estimates behind the verdict",
            tables=[fitted_table(diagnosis, values)],
        ),
        Section("flow_form", "Flow map", tables=flow_form_tables(diagnosis.flow_selection)),
        Section("notes", "Notes", note_sentences(diagnosis)),
        Section("symbols", "Symbols", tables=[_legend(diagnosis)]),
    ]  # fmt: skip


def _legend(diagnosis: Diagnosis) -> Table:
    """Return the meaning of the symbols that the page uses."""
    tables = diagnosis_tables(diagnosis)
    return legend_table("x v u p_P q_mP w σ", *tables)


def write_diagnosis(
    diagnosis: Diagnosis,
    folder: str | Path,
    catalogue: Catalogue = EFFECTS,
    refined: Identification | None = None,
    executor: Executor | None = None,
) -> Path:
    """Write a diagnosis into a folder.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    folder : path
        Folder to make. One that holds an earlier diagnosis is replaced; what you added to it stays.
    catalogue : mapping of str to effect class, optional
        Where the effects are described.
    refined : Identification, optional
        The final model refined by output error (`refine_diagnosis`), for ``result.json``.
    executor : Executor, optional
        Where figures are saved, several at a time; by default in this process.

    Returns
    -------
    Path
        The folder: ``diagnosis.json``, ``curves.json`` with the curves of the figures,
        ``report.html``, ``summary.txt``, ``figures`` as PNG, SVG and PDF, with `refined`
        ``result.json``, and ``discovered_term.json`` where a term was discovered.

    Raises
    ------
    CaseError
        If the folder holds no earlier diagnosis, or one that was changed.
    """
    diagnosis = with_refined_checks(diagnosis, refined)
    with output_folder(folder, OutputKind.DIAGNOSIS) as draft:
        write_json(diagnosis.as_dict(), draft / "diagnosis.json")
        if diagnosis.discovered is not None:
            write_term(diagnosis.discovered.term, draft / "discovered_term.json")
        if diagnosis.evidence is not None:
            curves = evidence_dict(diagnosis.evidence)
            (draft / CURVES).write_text(json.dumps(curves, allow_nan=False), "utf-8")
        if refined is not None:
            write_json(result_dict(refined), draft / "result.json")
        summary = summary_text(diagnosis, catalogue, refined)
        (draft / "summary.txt").write_text(summary, "utf-8")
        pictures = save_figures(_figures_of(diagnosis), draft / "figures", executor)
        final = None if refined is None else final_model(refined)
        html = diagnosis_html(diagnosis, pictures, catalogue, final)
        (draft / "report.html").write_text(html, "utf-8")
    return Path(folder)


def _figures_of(diagnosis: Diagnosis) -> "Iterable[Drawn]":
    """Return the figures; none without matplotlib."""
    if not can_draw():
        return ()
    from pneumo_casadi.report.pages.diagnosis_figures import diagnosis_figures

    return diagnosis_figures(diagnosis)


def drawn_pictures(diagnosis: Diagnosis) -> list[Picture]:
    """Return the figures as they stand in the report; none without matplotlib."""
    return [
        Picture(drawn.name, min(drawn.png(), drawn.svg(), key=len), drawn.caption)
        for drawn in _figures_of(diagnosis)
    ]
