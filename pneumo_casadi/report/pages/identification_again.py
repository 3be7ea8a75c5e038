"""The report of an identification from the plain values of its result file."""

from typing import Any

from pneumo_casadi.data.recording.curves import Curves
from pneumo_casadi.report.pages.drawing import can_draw
from pneumo_casadi.report.pages.identification import (
    next_record,
    usability_verdict,
    warning_sentences,
)
from pneumo_casadi.report.pages.page import TIME_FIGURE, Picture, Section, html_page, plots_of
from pneumo_casadi.report.tables.laboratory import estimate_table, laboratory_tables, legend_table
from pneumo_casadi.report.tables.validation import records_table, validation_table
from pneumo_casadi.validation import Error, Validation

CAPTION = "Held-out record {}, measured and simulated; below, measured minus simulated."


def identification_again(content: dict[str, Any], curves: tuple[Curves, ...]) -> str:
    """Return the report of an identification as one HTML page.

    Parameters
    ----------
    content : dict
        What ``result.json`` holds.
    curves : tuple of Curves
        Of ``curves.json``; none where there is no such file.
    """
    plots, left = plots_of(curves, time_pictures(curves, CAPTION))
    answer = (*laboratory_tables(content), estimate_table(content))
    errors = () if content["validation"] is None else (validation_table(validation_of(content)),)
    records = records_table(content["provenance"])
    sections = [
        Section("answer", "Parameters", (next_record(content),), tables=answer),
        Section("warnings", "Before you use these numbers", warning_sentences(content)),
        Section("trust", "Why to trust it", pictures=left, tables=(*errors, records), plots=plots),
        Section("symbols", "Symbols", tables=(legend_table("σ WLS u", *answer, *errors),)),
        Section("provenance", "Provenance", provenance=content["provenance"]),
    ]
    return html_page(f"Identification of {content['case']}", usability_verdict(content), sections)


def validation_of(content: dict[str, Any]) -> Validation:
    """Return the errors on held-out records, without their trajectories."""
    plain = content["validation"]
    outputs = [name for name in plain if name not in ("closed_loop", "windows", "records")]

    def errors(values: dict[str, Any]) -> dict[str, Error]:
        return {name: Error(**values[name]) for name in outputs if name in values}

    closed = plain["closed_loop"]
    windows = {float(length): errors(values) for length, values in plain["windows"].items()}
    origin = content.get("provenance", {})  # that of a validation of 0.1 is unknown
    return Validation(
        errors(plain), None if closed is None else errors(closed), windows, (), origin
    )


def time_pictures(curves: tuple[Curves, ...], caption: str) -> list[Picture]:
    """Return the still figures of time plots; the caption names the record as ``{}``."""
    if not curves or not can_draw():
        return []
    from pneumo_casadi.report.figures.style import png
    from pneumo_casadi.report.figures.time_series import time_series_figure

    return [
        Picture(
            f"{TIME_FIGURE}{each.record}",
            png(time_series_figure(each)),
            caption.format(each.record),
        )
        for each in curves
    ]
