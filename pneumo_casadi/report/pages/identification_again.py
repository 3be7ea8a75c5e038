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
from pneumo_casadi.report.tables.laboratory import laboratory_tables, legend_table
from pneumo_casadi.report.tables.table import (
    Table,
    exponent_of,
    interval_text,
    scaled_unit,
    with_symbols,
)
from pneumo_casadi.report.tables.validation import validation_table
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
    used = " ".join(row[0] for table in answer for row in table.rows) + " σ WLS u"
    sections = [
        Section("answer", "Parameters", (next_record(content),), tables=answer),
        Section("warnings", "Before you use these numbers", warning_sentences(content)),
        Section("trust", "Why to trust it", pictures=left, tables=errors, plots=plots),
        Section("symbols", "Symbols", tables=(legend_table(used),)),
        Section("provenance", "Provenance", provenance=content["provenance"]),
    ]
    return html_page(f"Identification of {content['case']}", usability_verdict(content), sections)


def estimate_table(content: dict[str, Any]) -> Table:
    """Return WLS and output error side by side, and the truth if it is known."""
    wls, truth = content["wls"]["parameters"], content["truth"] or {}
    fit = content["output_error"]
    wls = wls | (content["wls"]["derived"] or {})
    ratios = {name: fit["derived"][name] for name in ("k_P", "k_N") if name in fit["derived"]}
    rows = []
    for name, item in (fit["parameters"] | ratios).items():
        e = exponent_of(item["value"])
        linear = wls.get(name)
        rows.append(
            (
                with_symbols(name),
                scaled_unit("" if item["unit"] == "1" else item["unit"], e),
                "" if linear is None else _wls(linear, e),
                _interval(item, e) + (f" ({item['note']})" if "note" in item else ""),
                f"{truth[name] / 10.0**e:.4g}" if name in truth else "",
            )
        )
    columns = ("", "unit", "WLS", "output error", "truth")
    table = Table("Identified parameters, estimate ± 2σ", columns, tuple(rows))
    return table if truth else table.without("truth")


def _wls(item: dict[str, Any], exponent: int) -> str:
    """Return an estimate of WLS; only its parameters have an interval that allows for all."""
    return interval_text(item["value"], 2 * item.get("std_hac", item["std"]), exponent)


def _interval(item: dict[str, Any], exponent: int) -> str:
    stds = [item[key] for key in ("std", "std_robust") if item.get(key) is not None]
    return interval_text(item["value"], 2 * max(stds) if stds else None, exponent)


def validation_of(content: dict[str, Any]) -> Validation:
    """Return the errors on held-out records, without their trajectories."""
    plain = content["validation"]
    outputs = [name for name in plain if name not in ("closed_loop", "windows", "records")]

    def errors(values: dict[str, Any]) -> dict[str, Error]:
        return {name: Error(**values[name]) for name in outputs if name in values}

    closed = plain["closed_loop"]
    windows = {float(length): errors(values) for length, values in plain["windows"].items()}
    return Validation(errors(plain), None if closed is None else errors(closed), windows, ())


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
