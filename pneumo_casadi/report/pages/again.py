"""The report of an identification written again from its result file alone."""

from pathlib import Path
from typing import Any

from pneumo_casadi.data.recording.curves import Curves, curves_of
from pneumo_casadi.errors import CaseError
from pneumo_casadi.identification.result_file import FORMAT
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
from pneumo_casadi.runtime.json_input import check_format, read_json
from pneumo_casadi.runtime.output_folder import OutputKind, write_files
from pneumo_casadi.validation import Error, Validation

#: Names of the files of a report.
RESULT, CURVES, REPORT = "result.json", "curves.json", "report.html"


def write_report_again(path: str | Path) -> Path:
    """Write ``report.html`` beside a result file, from the file and ``curves.json`` beside it.

    Parameters
    ----------
    path : path
        Report folder of ``identify``, or a result file.

    Returns
    -------
    Path
        The report. It has verdict, parameters, warnings, errors and provenance, and the time
        plots where there is a ``curves.json``; other figures need the records.

    Raises
    ------
    CaseError
        If there is no such result, or its folder holds another report, as that of a diagnosis.
    """
    path = Path(path)
    file = path / RESULT if path.is_dir() else path
    content = read_json(file, "name a report folder of `identify`, or its result.json")
    check_format(content, FORMAT)
    try:
        html = _html(content, _curves(file.parent / CURVES))
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise CaseError(
            f"{file}: no complete result of `identify` ({type(error).__name__}: {error}); "
            "identify the case again"
        ) from None
    (report,) = write_files({REPORT: html}, file.parent, OutputKind.IDENTIFICATION)
    return report


def _curves(path: Path) -> tuple[Curves, ...]:
    if not path.exists():
        return ()
    return tuple(map(curves_of, read_json(path, "identify the case again")["records"]))


def _html(content: dict[str, Any], curves: tuple[Curves, ...]) -> str:
    plots, left = plots_of(curves, _pictures(curves))
    answer = (*laboratory_tables(content), _estimates(content))
    errors = () if content["validation"] is None else (validation_table(_validation(content)),)
    used = " ".join(row[0] for table in answer for row in table.rows) + " σ WLS u"
    sections = [
        Section("answer", "Parameters", (next_record(content),), tables=answer),
        Section("warnings", "Before you use these numbers", warning_sentences(content)),
        Section("trust", "Why to trust it", pictures=left, tables=errors, plots=plots),
        Section("symbols", "Symbols", tables=(legend_table(used),)),
        Section("provenance", "Provenance", provenance=content["provenance"]),
    ]
    return html_page(f"Identification of {content['case']}", usability_verdict(content), sections)


def _pictures(curves: tuple[Curves, ...]) -> list[Picture]:
    if not curves or not can_draw():
        return []
    from pneumo_casadi.report.figures.style import png
    from pneumo_casadi.report.figures.time_series import time_series_figure

    caption = "Held-out record {}, measured and simulated; below, measured minus simulated."
    return [
        Picture(
            f"{TIME_FIGURE}{each.record}",
            png(time_series_figure(each)),
            caption.format(each.record),
        )
        for each in curves
    ]


def _estimates(content: dict[str, Any]) -> Table:
    """Return WLS and output error side by side, and the truth if it is known."""
    wls, truth = content["wls"]["parameters"], content["truth"] or {}
    rows = []
    for name, item in content["output_error"]["parameters"].items():
        e = exponent_of(item["value"])
        linear = wls.get(name)
        rows.append(
            (
                with_symbols(name),
                scaled_unit("" if item["unit"] == "1" else item["unit"], e),
                "" if linear is None else _interval(linear, "std_hac", e),
                _interval(item, "std_robust", e) + (f" ({item['note']})" if "note" in item else ""),
                f"{truth[name] / 10.0**e:.4g}" if name in truth else "",
            )
        )
    columns = ("", "unit", "WLS", "output error", "truth")
    table = Table("Identified parameters, estimate ± 2σ", columns, tuple(rows))
    return table if truth else table.without("truth")


def _interval(item: dict[str, Any], robust: str, exponent: int) -> str:
    stds = [item[key] for key in ("std", robust) if item.get(key) is not None]
    return interval_text(item["value"], 2 * max(stds) if stds else None, exponent)


def _validation(content: dict[str, Any]) -> Validation:
    """Return the errors on held-out records, without their trajectories."""
    plain = content["validation"]
    outputs = [name for name in content["output_error"]["sigma"] if name in plain]

    def errors(values: dict[str, Any]) -> dict[str, Error]:
        return {name: Error(**values[name]) for name in outputs if name in values}

    closed = plain["closed_loop"]
    windows = {float(length): errors(values) for length, values in plain["windows"].items()}
    return Validation(errors(plain), None if closed is None else errors(closed), windows, ())
