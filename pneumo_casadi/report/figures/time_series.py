"""Outputs over time, measured and simulated: the whole record, and where they differ most."""

from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pneumo_casadi.data.recording.curves import MEASURED, Curves
from pneumo_casadi.report.figures.style import (
    HEAD,
    LINE,
    PAGE,
    TEXT,
    axis_label,
    block_means,
    dress,
    legend_above,
    new_figure,
    thin,
)
from pneumo_casadi.report.interactive.look import detail_seconds, line_look

#: Residuals are averaged over blocks of this length [s], so that they show beside the noise.
AVERAGED = 0.02
#: Curves in a row of the legend.
LEGEND = 3
#: The colour of what is drawn enlarged.
_SHADE = "#f2e9c9"


def time_series_figure(curves: Curves) -> Figure:
    """Draw the outputs of a record and the residuals below; enlarged on the right.

    Parameters
    ----------
    curves : Curves
        Measured and simulated outputs of one record.
    """
    outputs = tuple(curves.values)
    head = HEAD * ceil(len(curves.values[outputs[0]]) / LEGEND)
    figure = new_figure(10.0 + head + 34.0 * len(outputs), PAGE, head=head)
    grid = figure.subplots(
        2 * len(outputs), 2, sharex="col", squeeze=False,
        height_ratios=[2, 1.1] * len(outputs), width_ratios=[1.7, 1],
    )  # fmt: skip
    detail = curves.largest_difference(detail_seconds(curves))
    for i, output in enumerate(outputs):
        for column in range(2):
            _draw(grid[2 * i, column], grid[2 * i + 1, column], curves, output, i, column, detail)
    legend_above(grid[0, 0], LEGEND)
    for axes in grid[-1]:
        axes.set_xlabel("$t$ [s]", fontsize=TEXT)
    figure.align_ylabels(list(grid[:, 0]))
    return figure


def _draw(
    above: Axes, below: Axes, curves: Curves, output: str, i: int, column: int,
    detail: tuple[float, float],
) -> None:  # fmt: skip
    """Draw one output and its residuals, whole (column 0) or enlarged (column 1)."""
    unit = curves.units[output]
    label, factor = axis_label(output, unit)
    error_label, error_factor = axis_label("error", unit)
    shown = slice(None)
    if column == 1:
        first, end = np.searchsorted(curves.t, detail)
        shown = slice(int(first), int(end) + 1)
    for k, (name, curve) in enumerate(curves.values[output].items()):
        t, y = thin(curves.t[shown], curve[shown])
        measured = name == MEASURED
        colour, dash = line_look(k)
        look: dict[str, Any] = {"color": colour, "linestyle": dash}
        above.plot(t, y * factor, **look, linewidth=2.2 if measured else LINE, label=name)
        if not measured:
            t, e = block_means(curves.t[shown], curves.residual(output, name)[shown], AVERAGED)
            below.plot(t, e * error_factor, **look, linewidth=0.6)
    if curves.noise[output]:
        band = 2 * curves.noise[output] * error_factor
        below.axhspan(-band, band, color="#dddddd", linewidth=0, zorder=0.5)
    if column == 0:
        for axes in (above, below):
            axes.axvspan(*detail, color=_SHADE, linewidth=0, zorder=0.2)
    dress(above, None, label if column == 0 else None)
    dress(below, None, error_label if column == 0 else None)
