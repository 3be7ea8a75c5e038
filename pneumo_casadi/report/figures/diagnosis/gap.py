"""The gap on held-out data, without effects and with them."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pneumo_casadi.diagnosis import Diagnosis
from pneumo_casadi.report.figures.style import (
    BLACK,
    HEAD,
    REST,
    ROW,
    SMALL,
    TEXT,
    dress,
    legend_above,
    new_figure,
    symbol,
)
from pneumo_casadi.report.interactive.look import COLOURS
from pneumo_casadi.report.tables.diagnosis import VIEWS, gap_models
from pneumo_casadi.report.tables.quantities import percent
from pneumo_casadi.report.tables.table import plain

#: Height of all bars of an output [rows].
_BARS = 0.76


def gap_figure(diagnosis: Diagnosis) -> Figure:
    """Draw the gap before and after, one panel a view."""
    views = [name for name in (*VIEWS, *diagnosis.gap.views) if name in diagnosis.gap.views]
    views = list(dict.fromkeys(views))
    counts = [len(diagnosis.gap.views[name]) for name in views]
    models = gap_models(diagnosis)
    height = sum(ROW * (0.7 + 0.35 * len(models)) * n + REST + 2 for n in counts) + HEAD
    figure = new_figure(height, head=HEAD)
    panels = figure.subplots(len(views), 1, squeeze=False, height_ratios=counts)[:, 0]
    for axes, view in zip(panels, views, strict=True):
        draw_gap(axes, view, diagnosis.gap.views[view], models)
    gap_legend(panels[0], models)
    return figure


def draw_gap(
    axes: Axes, view: str, outputs: Mapping[str, Mapping[str, float]], models: Mapping[str, str]
) -> None:
    """Draw one view of the gap into given axes, a row an output.

    Parameters
    ----------
    models : mapping of str to str
        Keys of the values to draw, and names; see `gap_models`. One that the view lacks is left
        out.
    """
    y = np.arange(len(outputs), dtype=float)
    shown = {
        key: label for key, label in models.items() if all(key in gap for gap in outputs.values())
    }
    pitch = _BARS / len(shown)
    noise = [gap["noise"] for gap in outputs.values()]
    largest = max(max(gap[key] for key in (*shown, "noise")) for gap in outputs.values())
    colours = dict(zip(models, COLOURS[1:], strict=False))  # as in time plots
    for i, (key, label) in enumerate(shown.items()):
        at = y + (i - (len(shown) - 1) / 2) * pitch
        values = [gap[key] for gap in outputs.values()]
        axes.barh(at, values, min(0.9 * pitch, 0.6), color=colours[key], label=label, zorder=2)
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


def gap_legend(axes: Axes, models: Mapping[str, str]) -> None:
    """Put the names of the models and of the noise above a view, in as many columns as fit."""
    legend_above(axes, 2 if len(models) > 2 else 3)


def gap_labels(diagnosis: Diagnosis) -> list[str]:
    """Return the names of the models without effects, and with them where that was simulated."""
    models = gap_models(diagnosis)
    models.pop("with_term", None)
    return list(models.values())
