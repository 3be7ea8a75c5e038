"""Where model and measurement disagree: balances, and conditions during the record."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pneumo_casadi.diagnosis import Diagnosis, Regime
from pneumo_casadi.report.figures.style import (
    BLUE,
    GREY,
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
from pneumo_casadi.report.tables.quantities import percent


def where_figure(diagnosis: Diagnosis) -> Figure:
    """Draw the share of each balance, and conditions with their shares of residual and time."""
    shares, regimes = diagnosis.where.shares, diagnosis.where.regimes
    heights = [ROW * len(shares) + REST]
    if regimes:
        heights.append(ROW * 2.2 * len(regimes) + REST)
    figure = new_figure(sum(heights))
    panels = figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    draw_shares(panels[0], shares)
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


def draw_shares(axes: Axes, shares: Mapping[str, float]) -> None:
    """Draw the share of each balance in the unknown inputs."""
    y = np.arange(len(shares))
    axes.barh(y, [100 * share for share in shares.values()], 0.6, color=BLUE, zorder=2)
    for i, share in enumerate(shares.values()):
        write_at_bar(axes, 100 * share, i, percent(100 * share))
    dress(axes, "share of the unknown inputs [%]")
    axes.set_yticks(y, [symbol(name) for name in shares], fontsize=TEXT)
    axes.set_ylim(len(shares) - 0.45, -0.55)
    axes.set_xlim(0, 104)
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)
