"""The report of a validation on its own: errors on held-out records, and the records over time."""

from collections.abc import Sequence

from pneumo_casadi.data.recording.curves import Curves
from pneumo_casadi.identification.warnings import (
    judge_usability,
    simulation_sentence,
    validation_warnings,
)
from pneumo_casadi.report.pages.identification import VERDICTS
from pneumo_casadi.report.pages.page import Picture, Section, Verdict, html_page, plots_of
from pneumo_casadi.report.tables.laboratory import legend_table
from pneumo_casadi.report.tables.validation import records_table, validation_table
from pneumo_casadi.validation import Validation


def validation_html(
    validation: Validation, curves: Sequence[Curves], pictures: Sequence[Picture]
) -> str:
    """Return a validation as one HTML page.

    Parameters
    ----------
    validation : Validation
        Errors on the held-out records.
    curves : sequence of Curves
        The records over time.
    pictures : sequence of Picture
        The still figures of its time plots.
    """
    plots, left = plots_of(curves, pictures)
    warnings = tuple(validation_warnings(validation))
    usability = judge_usability(warnings, simulation_sentence(validation))
    grade, words = VERDICTS[usability.usable]
    sentence = usability.reason[:1].upper() + usability.reason[1:]
    sections = [
        Section("errors", "Errors on held-out records", tables=[validation_table(validation)]),
        Section("simulation", "Measurement and simulation", pictures=left, plots=plots),
        Section("symbols", "Symbols", tables=[legend_table("x p_P P, N")]),
        Section(
            "provenance", "Provenance", tables=[records_table(validation.provenance)],
            provenance=validation.provenance,
        ),
    ]  # fmt: skip
    return html_page("Validation on held-out records", Verdict(grade, words, sentence), sections)
