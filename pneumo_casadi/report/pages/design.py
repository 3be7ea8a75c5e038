"""A designed experiment as a page and as files."""

from collections.abc import Mapping
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pneumo_casadi.design import (
    Criterion,
    Design,
    DesignOptions,
    Distance,
    Limits,
    Part,
    Precision,
    Reference,
)
from pneumo_casadi.design.experiment import SimulatedExperiment
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.report.pages.drawing import can_draw
from pneumo_casadi.report.pages.page import Picture, Section, Verdict, html_page
from pneumo_casadi.report.tables.laboratory import legend_table
from pneumo_casadi.report.text.design import design_tables, design_text
from pneumo_casadi.runtime.json_files import write_json
from pneumo_casadi.runtime.output_folder import OutputKind, output_folder
from pneumo_casadi.runtime.progress import Progress, no_progress
from pneumo_casadi.runtime.provenance import provenance

Content = Mapping[str, Any]

CAPTION = (
    "The designed reference with the simulated position, both pressures and both commands; below, "
    "what it is predicted to gain over the recorded one."
)


def write_design(design: Design, folder: str | Path, progress: Progress | None = None) -> Path:
    """Write a design into a folder: reference, prediction as page, JSON and text, figure.

    Parameters
    ----------
    design : Design
        What was designed.
    folder : path
        Folder to make. One that holds an earlier design is replaced; what you added to it stays.
    progress : callable, optional
        Called as ``progress(text, share)``.

    Returns
    -------
    Path
        The folder: ``reference.csv``, ``report.html``, ``design.json``, ``design.txt``, and the
        figure as ``design.png``, ``.svg`` and ``.pdf``.

    Raises
    ------
    CaseError
        If the folder holds no earlier design, or one that was changed.
    """
    report = progress or no_progress
    report("figure", 0.0)
    with output_folder(folder, OutputKind.DESIGN) as draft:
        frame = reference_frame(design)
        frame.to_csv(draft / "reference.csv", index=False, lineterminator="\n")
        origin = _origin(design)
        write_json(design.as_dict() | {"provenance": origin}, draft / "design.json")
        (draft / "design.txt").write_text(design_text(design) + "\n", "utf-8")
        pictures = []
        if can_draw():
            from pneumo_casadi.report.figures.studies.design import design_figure
            from pneumo_casadi.report.figures.style import save_figure

            save_figure(design_figure(design), draft / "design")
            pictures.append(Picture("design", (draft / "design.png").read_bytes(), CAPTION))
        (draft / "report.html").write_text(design_html(design, pictures, origin), "utf-8")
    report("done", 1.0)
    return Path(folder)


def reference_frame(design: Design) -> pd.DataFrame:
    """Return the reference in columns: t_s, x_ref_m and, where it is allowed, u_common_V.

    u_common is to be added to what the controller sends to either valve.
    """
    reference = design.reference
    columns = {"t_s": np.round(reference.t, 10), "x_ref_m": reference.x_ref}
    if design.options.limits.common > 0:
        columns["u_common_V"] = reference.common
    return pd.DataFrame(columns)


def _origin(design: Design) -> dict[str, Any]:
    return provenance(
        [],
        {"evaluations": design.options.evaluations, "kinds": list(design.options.kinds)},
        seeds={"search": design.options.seed},
    )


def design_html(
    design: Design, pictures: list[Picture], origin: Mapping[str, Any] | None = None
) -> str:
    """Return a design as one HTML page.

    Parameters
    ----------
    design : Design
        What was designed.
    pictures : list of Picture
        Its figure; empty without matplotlib.
    origin : mapping, optional
        Provenance as written with it; by default that of now.
    """
    gained, *others = design_tables(design)
    facts = [
        ("Duration", f"{design.reference.duration:g} s"),
        ("Gain over the recorded reference", f"{design.gain:.3g} times"),
        ("Kept within the limits of", "position, velocity, command and pressure"),
        (
            "Next",
            "record the motion of reference.csv under the controller of bench.json, then "
            "`identify` with both records",
        ),
    ]
    worth = "good" if design.gain > 1 else "care"
    words = "Reference designed" if design.gain > 1 else "No better than the recorded reference"
    sections = [
        Section("gain", "Predicted gain", design.notes, pictures, [gained]),
        Section("reference", "Reference and limits", tables=others),
        Section("symbols", "Symbols", tables=[legend_table("x u p_P", gained)]),
        Section("provenance", "Provenance", provenance=origin or _origin(design)),
    ]
    verdict = Verdict(worth, words, design.headline, facts)
    return html_page("Design of an experiment", verdict, sections)


def design_again(content: Content, folder: Path) -> str:
    """Return the page of a design from its `design.json` alone; the figure is that beside it.

    Parameters
    ----------
    content : mapping
        Plain values of ``design.json``.
    folder : path
        Where ``design.png`` may be.
    """
    picture = folder / "design.png"
    drawn = [Picture("design", picture.read_bytes(), CAPTION)] if picture.exists() else []
    return design_html(_design(content), drawn, content.get("provenance"))


def _design(content: Content) -> Design:
    """Return what is shown of a design; of its runs only the extremes are in the file."""
    limits = content["limits"]
    names = ("position_m", "velocity_m_per_s", "p_min_Pa", "p_max_Pa", "command_V", "common_V")
    options = DesignOptions(
        Limits(*(limits[name] for name in names)),
        content["duration_s"],
        evaluations=content["evaluations"],
        seed=content["seed"],
    )
    dt = content["sampling_period_s"]
    N = round(content["duration_s"] / dt)
    reference = Reference(dt, np.zeros(N), np.zeros(N))
    precision = content["precision"]
    return Design(
        reference,
        tuple(_part(item) for item in content["parts"]),
        options,
        {"extremes": _run(reference, content["extremes"])},
        (),
        None if precision is None else _precision(precision),
        tuple(_distance(item) for item in content["distances"]),
        content["seconds"],
        tuple(content["notes"]),
    )


def _part(item: Content) -> Part:
    values = tuple(number["value"] for number in item["numbers"].values())
    return Part(item["kind"], item["share"], values)


def _run(reference: Reference, extremes: Content) -> SimulatedExperiment:
    """Return a run of two samples with these extremes."""
    pressures = [extremes["p_min"], extremes["p_max"]]
    ends = [[extremes[name]] * 2 for name in ("position", "velocity")]
    x = np.array([pressures, pressures, *ends])
    return SimulatedExperiment(reference, x, np.zeros((2, 2)), x[:3], extremes["command"])


def _precision(item: Content) -> Precision:
    parameters = item["parameters"]

    def column(key: str) -> FloatArray:
        return np.array([_number(each[key]) for each in parameters.values()])

    return Precision(
        tuple(parameters),
        tuple(each["unit"] for each in parameters.values()),
        column("value"),
        column("std_now"),
        column("std_designed"),
        column("std_both"),
        Criterion(item["criterion"]),
        _number(item["now"]),
        _number(item["designed"]),
        _number(item["both"]),
    )


def _distance(item: Content) -> Distance:
    before, after = _number(item["before"]), _number(item["after"])
    return Distance(item["truth"], item["fitted"], before, after, item["samples"], item["hidden"])


def _number(value: float | None) -> float:
    return inf if value is None else value
