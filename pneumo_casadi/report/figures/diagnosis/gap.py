"""The gap on held-out data, without effects and with them."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pneumo_casadi.diagnosis import Diagnosis
from pneumo_casadi.report.figures.style import (
    BLACK,
    BLUE,
    HEAD,
    ORANGE,
    REST,
    ROW,
    SMALL,
    TEXT,
    dress,
    legend_above,
    new_figure,
    symbol,
)
from pneumo_casadi.report.tables.diagnosis import VIEWS, has_after, with_what
from pneumo_casadi.report.tables.quantities import percent, plain

#: Without effects, with them.
BEFORE, AFTER = ORANGE, BLUE


def gap_figure(diagnosis: Diagnosis) -> Figure:
    """Draw the gap before and after, one panel a view."""
    views = [name for name in (*VIEWS, *diagnosis.gap.views) if name in diagnosis.gap.views]
    views = list(dict.fromkeys(views))
    counts = [len(diagnosis.gap.views[name]) for name in views]
    height = sum(ROW * 1.4 * n + REST + 2 for n in counts) + HEAD
    figure = new_figure(height, head=HEAD)
    panels = figure.subplots(len(views), 1, squeeze=False, height_ratios=counts)[:, 0]
    for axes, view in zip(panels, views, strict=True):
        draw_gap(axes, view, diagnosis.gap.views[view], gap_labels(diagnosis))
    legend_above(panels[0], 3)
    return figure


def draw_gap(
    axes: Axes, view: str, outputs: Mapping[str, Mapping[str, float]], labels: list[str]
) -> None:
    """Draw one view of the gap into given axes, a row an output."""
    y = np.arange(len(outputs), dtype=float)
    both = len(labels) == 2
    kinds = [("before", BEFORE, -0.2), ("after", AFTER, 0.2)]
    thick = 0.36 if both else 0.6
    noise = [gap["noise"] for gap in outputs.values()]
    largest = max(max(gap["before"], gap["after"], gap["noise"]) for gap in outputs.values())
    for label, (key, colour, shift) in zip(labels, kinds, strict=False):
        at = y + (shift if both else 0.0)
        values = [gap[key] for gap in outputs.values()]
        axes.barh(at, values, thick, color=colour, label=label, zorder=2)
        for row, value, mark in zip(at, values, noise, strict=True):
            # Beyond the mark where the number would stand on it.
            end = mark if value <= mark < value + 0.13 * largest else value
            axes.annotate(
                percent(value).removesuffix(" %"), (end, row), (2, -0.4),
                textcoords="offset points", va="center", fontsize=SMALL - 1.0, zorder=4,
            )  # fmt: skip
    axes.vlines(noise, y - 0.42, y + 0.42, color=BLACK, linewidth=1.2, label="noise", zorder=3)
    names = [symbol(name) for name in outputs]
    dress(axes, f"gap, {VIEWS.get(view, plain(view))} [%]")
    axes.set_yticks(y, names, fontsize=TEXT)
    axes.set_ylim(len(outputs) - 0.45, -0.55)
    axes.set_xlim(0, 1.14 * largest if largest > 0 else 1.0)
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)


def gap_labels(diagnosis: Diagnosis) -> list[str]:
    """Name the bars: without effects, and with effects where that was simulated."""
    if not has_after(diagnosis):
        return ["without effects"]
    return ["without effects", with_what(diagnosis)]
