"""Where model and measurement disagree: balances, and conditions during the record."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pneumo_casadi.diagnosis import Diagnosis, Regime, Where
from pneumo_casadi.report.figures.style import (
    BLUE,
    GREY,
    HEAD,
    REST,
    ROW,
    SKY,
    SMALL,
    TEXT,
    dress,
    legend_above,
    new_figure,
    symbol,
    write_at_bar,
)
from pneumo_casadi.report.interactive.look import COLOURS
from pneumo_casadi.report.tables.quantities import percent
from pneumo_casadi.report.tables.table import plain


def where_figure(diagnosis: Diagnosis) -> Figure:
    """Draw the share of each balance, and conditions with their shares of residual and time."""
    where, regimes = diagnosis.where, diagnosis.where.regimes
    heights = [ROW * len(where.shares) + REST + (HEAD if len(_sized(where)) > 1 else 0.0)]
    if regimes:
        heights.append(ROW * 2.2 * len(regimes) + REST)
    figure = new_figure(sum(heights))
    panels = figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    draw_location(panels[0], where)
    if regimes:
        draw_regimes(panels[1], regimes)
        legend = panels[1].get_legend()
        assert legend is not None
        legend.set_in_layout(True)  # there is another panel above it
    return figure


def draw_regimes(axes: Axes, regimes: Sequence[Regime]) -> None:
    """Draw the conditions with a larger share of the residual than of the time."""
    y = np.arange(len(regimes), dtype=float)
    share, time = ([100 * getattr(regime, key) for regime in regimes] for key in ("share", "time"))
    axes.barh(y + 0.02, share, 0.22, color=SKY, label="of the residual", zorder=2)
    axes.barh(y + 0.26, time, 0.22, color=GREY, label="of the time", zorder=2)
    for i, regime in enumerate(regimes):
        # Names are too long to stand beside the bars in a column.
        text = f"{regime.name}, {symbol(regime.balance)}"
        axes.text(0.6, i - 0.26, text, fontsize=SMALL, va="center", zorder=3)
    dress(axes, "share [%]")
    axes.set_yticks([])
    axes.set_ylim(len(regimes) - 0.5, -0.55)
    axes.set_xlim(0, 104)
    axes.grid(False, axis="y")
    legend_above(axes, 2)


def draw_location(axes: Axes, where: Where) -> None:
    """Draw what the effects found add to each balance; without effects, what each one lacks.

    It is what the sentence on the location is made from: both name the same balance.
    """
    names, sizes = list(where.shares), _sized(where)
    if sizes:
        _draw_sizes(axes, names, sizes)
        dress(axes, "added by the effects [% of the balance's signal]")
    else:
        for i, share in enumerate(where.shares.values()):
            axes.barh(i, 100 * share, 0.6, color=BLUE, zorder=2)
            write_at_bar(axes, 100 * share, i, percent(100 * share))
        dress(axes, "share of the unknown inputs [%]")
        axes.set_xlim(0, 104)
    axes.set_yticks(np.arange(len(names)), [symbol(name) for name in names], fontsize=TEXT)
    axes.set_ylim(len(names) - 0.45, -0.55)
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)


def _sized(where: Where) -> dict[str, Mapping[str, float]]:
    """Return the effects that add to a balance: not those in a sensor."""
    return {cause: sizes for cause, sizes in where.sizes.items() if sizes}


def _draw_sizes(axes: Axes, names: Sequence[str], sizes: Mapping[str, Mapping[str, float]]) -> None:
    pitch = 0.76 / len(sizes)
    largest = 100 * max(max(each.values()) for each in sizes.values())
    for k, (cause, added) in enumerate(sizes.items()):
        at = np.arange(len(names)) + (k - (len(sizes) - 1) / 2) * pitch
        values = [100 * added.get(name, 0.0) for name in names]
        colour = COLOURS[1:][k % (len(COLOURS) - 1)]
        axes.barh(at, values, min(0.9 * pitch, 0.6), color=colour, label=plain(cause), zorder=2)
        for row, value in zip(at, values, strict=True):
            if value == 0:
                continue
            axes.annotate(
                percent(value), (value, row), (2, -0.4), textcoords="offset points", va="center",
                fontsize=SMALL - 1.0, zorder=4,
            )  # fmt: skip
    room = 1.18 if len(sizes) == 1 else 2.2  # for the numbers, and the legend beside them
    axes.set_xlim(0, room * largest if largest > 0 else 1.0)
    if len(sizes) > 1:
        axes.legend(fontsize=SMALL - 1.0, frameon=False, loc="lower right")
