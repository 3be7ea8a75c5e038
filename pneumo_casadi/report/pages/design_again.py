"""The page of a design from its `design.json` alone; the figure is that beside it."""

from collections.abc import Mapping
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from pneumo_casadi.design import Criterion, Design, DesignOptions, Distance, Part, Precision
from pneumo_casadi.design.experiment import Limits, SimulatedExperiment
from pneumo_casadi.design.reference import Reference
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.report.pages.design import CAPTION, design_html
from pneumo_casadi.report.pages.page import Picture

Content = Mapping[str, Any]


def design_again(content: Content, folder: Path) -> str:
    """Return the page of a design.

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
        *(column(f"std_{key}") for key in ("now", "designed", "both")),
        Criterion(item["criterion"]),
        *(_number(item[key]) for key in ("now", "designed", "both")),
    )


def _distance(item: Content) -> Distance:
    sizes = (_number(item[key]) for key in ("before", "after"))
    return Distance(item["truth"], item["fitted"], *sizes, item["samples"], item["hidden"])


def _number(value: float | None) -> float:
    return inf if value is None else value
