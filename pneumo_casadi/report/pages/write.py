"""Report folders: written beside their place, then renamed, so that none is ever half there."""

import json
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING

from pneumo_casadi.data.recording.curves import Curves
from pneumo_casadi.identification.comparison import Comparison
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.identification.result_file import result_dict, validation_dict
from pneumo_casadi.identification.trajectory_file import (
    RecordSimulation,
    trajectory_frame,
    write_frames,
)
from pneumo_casadi.report.interactive.time_plot import load_bokeh
from pneumo_casadi.report.pages.comparison import comparison_html, overlays
from pneumo_casadi.report.pages.drawing import can_draw
from pneumo_casadi.report.pages.identification import html_report
from pneumo_casadi.report.pages.page import Picture
from pneumo_casadi.report.pages.validation import validation_html
from pneumo_casadi.report.tables.comparison import comparison_tables
from pneumo_casadi.report.tables.validation import validation_table
from pneumo_casadi.report.text.identification import render, text_report
from pneumo_casadi.runtime.json_files import write_json
from pneumo_casadi.runtime.output_folder import OutputKind, output_folder
from pneumo_casadi.runtime.progress import Progress, no_progress
from pneumo_casadi.validation import Validation

if TYPE_CHECKING:
    from pneumo_casadi.report.pages.identification_figures import Drawn


def write_identification(
    identification: Identification,
    folder: str | Path,
    paper: bool = False,
    progress: Progress | None = None,
    executor: Executor | None = None,
) -> Path:
    """Write the report of an identification.

    Parameters
    ----------
    identification : Identification
        What was identified.
    folder : path
        Folder to make. One that holds an earlier report is replaced; what you added to it stays.
    paper : bool, optional
        Whether to set the paper's Table 1 beside the results.
    progress : callable, optional
        Called as ``progress(text, share)``.
    executor : Executor, optional
        Where figures are saved, several at a time; by default in this process.

    Returns
    -------
    Path
        The folder: ``result.json``, ``curves.json`` with the held-out records over time,
        ``report.html``, ``table.txt``, ``figures`` as PNG, SVG and PDF.

    Raises
    ------
    CaseError
        If the folder holds no earlier report, or one that was changed.
    """
    report = progress or no_progress
    with output_folder(folder, OutputKind.IDENTIFICATION) as draft:
        write_json(result_dict(identification), draft / "result.json")
        if identification.validation is not None:
            _write_curves(identification.validation.curves, draft)
        (draft / "table.txt").write_text(text_report(identification, paper), "utf-8")
        report("figures", 0.1)
        pictures = save_figures(_figures_of(identification), draft / "figures", executor)
        (draft / "report.html").write_text(html_report(identification, pictures, paper), "utf-8")
    report("done", 1.0)
    return Path(folder)


def write_validation(
    validation: Validation, folder: str | Path, progress: Progress | None = None
) -> Path:
    """Write errors and figures of a validation on its own into a folder.

    ``result.json``, ``table.txt``, ``figures``, and ``report.html`` with the records over time,
    which are in ``curves.json``. `progress` is called as ``progress(text, share)``.
    """
    report = progress or no_progress
    report("figures", 0.0)
    with output_folder(folder, OutputKind.VALIDATION) as draft:
        content = {
            "validation": validation_dict(validation),
            "provenance": dict(validation.provenance),
        }
        write_json(content, draft / "result.json")
        (draft / "table.txt").write_text(render(validation_table(validation)) + "\n", "utf-8")
        _write_curves(validation.curves, draft)
        pictures = save_figures(_figures_of(validation), draft / "figures")
        report("page", 0.9)
        html = validation_html(validation, validation.curves, pictures)
        (draft / "report.html").write_text(html, "utf-8")
    report("done", 1.0)
    return Path(folder)


def _write_curves(curves: Sequence[Curves], folder: Path) -> None:
    records = [each.as_dict() for each in curves]
    (folder / "curves.json").write_text(json.dumps({"records": records}), "utf-8")


def write_simulations(runs: Sequence[RecordSimulation], folder: str | Path) -> tuple[Path, ...]:
    """Write simulations as CSV into ``folder/simulation``, one file a record."""
    with output_folder(folder, OutputKind.SIMULATION) as draft:
        (draft / "simulation").mkdir()
        frames = [(run.record.name, trajectory_frame(run)) for run in runs]
        written = write_frames(frames, draft / "simulation")
    return tuple(Path(folder) / "simulation" / path.name for path in written)


def write_comparison(
    comparison: Comparison, folder: str | Path, progress: Progress | None = None
) -> Path:
    """Write a comparison of results into a folder.

    ``comparison.json``, ``comparison.txt``, ``curves.json`` and ``report.html`` with all
    simulations over time. `progress` is called as ``progress(text, share)``.
    """
    report = progress or no_progress
    report("figures", 0.0)
    with output_folder(folder, OutputKind.COMPARISON) as draft:
        write_json(comparison.as_dict(), draft / "comparison.json")
        tables = comparison_tables(comparison)
        text = "\n\n\n".join([comparison.headline, *map(render, tables)])
        (draft / "comparison.txt").write_text(text + "\n", "utf-8")
        _write_curves(comparison.curves, draft)
        pictures = save_figures(overlays(comparison), draft / "figures")
        report("page", 0.9)
        (draft / "report.html").write_text(comparison_html(comparison, pictures), "utf-8")
    report("done", 1.0)
    return Path(folder)


def _figures_of(result: Identification | Validation) -> "Iterable[Drawn]":
    """Return the figures of a result; none without matplotlib."""
    if not can_draw():
        return ()
    from pneumo_casadi.report.pages.identification_figures import figures_of, validation_figures

    if isinstance(result, Validation):
        return validation_figures(result)
    return figures_of(result)


def save_figures(
    figures: "Iterable[Drawn]", folder: Path, executor: Executor | None = None
) -> list[Picture]:
    """Save figures as PNG, SVG and PDF; return the smaller of the first two of each.

    The fonts of a PDF take longest: with an executor several figures are drawn at a time. One that
    fails there is drawn here: nothing is lost because a worker was.
    """
    folder.mkdir()
    if executor is None:
        return [_saved(folder, drawn, drawn.files()) for drawn in figures]
    jobs = [(drawn, executor.submit(drawn.files)) for drawn in figures]
    load_bokeh()  # the page needs it next
    pictures = []
    for drawn, job in jobs:
        try:
            contents = job.result()
        except Exception:
            contents = drawn.files()
        pictures.append(_saved(folder, drawn, contents))
    return pictures


def _saved(folder: Path, drawn: "Drawn", contents: Mapping[str, bytes]) -> Picture:
    for suffix, content in contents.items():
        (folder / f"{drawn.name}.{suffix}").write_bytes(content)
    return Picture(drawn.name, min(contents["png"], contents["svg"], key=len), drawn.caption)
