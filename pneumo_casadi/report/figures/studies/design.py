"""The figure of a designed experiment: what is asked, what the model does, what is gained."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from pneumo_casadi.design import Design, Precision
from pneumo_casadi.report.figures.style import (
    BLACK,
    BLUE,
    GREY,
    HEAD,
    LINE,
    ORANGE,
    SKY,
    SMALL,
    VERMILION,
    dress,
    legend_above,
    new_figure,
    symbol,
    thin,
)

#: Heights [mm]: of the trajectories, and of a row of the gain.
TRAJECTORIES, ROW = 78.0, 3.6
#: Ratio of an axis' ends below which decades alone are too few ticks.
CLOSE = 300.0


def design_figure(design: Design) -> Figure:
    """Draw reference, position, pressures and commands, and the predicted gain below them."""
    rows = len(design.distances if design.precision is None else design.precision.names)
    gained = 12.0 + ROW * rows
    figure = new_figure(TRAJECTORIES + gained, head=HEAD)
    panels = figure.subplots(4, 1, height_ratios=[24, 22, 22, gained])
    _trajectories(list(panels[:3]), design)
    if design.precision is not None:
        _errors(panels[3], design.precision)
    else:
        _distances(panels[3], design)
    return figure


def _trajectories(panels: list[Axes], design: Design) -> None:
    run = next(iter(design.runs.values()))
    reference = design.reference
    t, x_ref, x, p_P, p_N, u_P, u_N = thin(
        reference.t, 1e3 * reference.x_ref, 1e3 * run.y[2], *(1e-3 * run.y[:2]), *run.u[:2]
    )
    curves = (
        ((x_ref, "reference", GREY), (x, "position", BLUE)),
        ((p_P, "$p_P$", VERMILION), (p_N, "$p_N$", SKY)),
        ((u_P, "$u_P$", VERMILION), (u_N, "$u_N$", SKY)),
    )
    labels = ("$x$ [mm]", "$p$ [kPa]", "$u$ [V]")
    for axes, lines, label in zip(panels, curves, labels, strict=True):
        for values, name, colour in lines:
            axes.plot(t, values, color=colour, linewidth=LINE, label=name)
        axes.set_xlim(t[0], t[-1])
        dress(axes, "$t$ [s]" if axes is panels[-1] else None, label)
        if axes is not panels[-1]:
            axes.tick_params(labelbottom=False)
    legend_above(panels[0], 2)
    for axes in panels[1:]:
        axes.legend(fontsize=SMALL, frameon=False, loc="upper right", ncols=2, borderaxespad=0.1)


def _errors(axes: Axes, precision: Precision) -> None:
    at = np.arange(len(precision.names))[::-1]
    unit = np.where(precision.values == 0, 1.0, np.abs(precision.values))
    shown = (
        (precision.now, "recorded", GREY, "s"),
        (precision.designed, "designed", BLUE, "o"),
        (precision.together, "both", BLACK, "|"),
    )
    for values, name, colour, marker in shown:
        percent = 100 * values / unit
        axes.plot(percent, at, marker, color=colour, markersize=3.5, label=name)
    axes.set_yticks(at, [symbol(name) for name in precision.names])
    _finished(axes, "standard error [%]", len(at))


def _distances(axes: Axes, design: Design) -> None:
    at = np.arange(len(design.distances))[::-1]
    for values, name, colour, marker in (
        ([distance.before for distance in design.distances], "recorded", GREY, "s"),
        ([distance.after for distance in design.distances], "designed", BLUE, "o"),
    ):
        shown = np.maximum(values, 1e-2)  # a logarithmic axis has no zero
        axes.plot(shown, at, marker, color=colour, markersize=3.5, label=name)
    noise = float(np.sqrt(design.distances[0].samples))
    axes.axvline(noise, color=ORANGE, linewidth=0.8, label="noise")
    pairs = [f"{distance.truth} as {distance.fitted}" for distance in design.distances]
    names = [pair.replace("_", " ") for pair in pairs]
    axes.set_yticks(at, names)
    _finished(axes, "refitted distance [standard deviations]", len(at))


def _finished(axes: Axes, label: str, rows: int) -> None:
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if high / low < CLOSE else (1,)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(-0.7, rows - 0.3)
    dress(axes, label)
    axes.legend(
        fontsize=SMALL, frameon=False, ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0),
        borderaxespad=0.1, handlelength=1.0,
    )  # fmt: skip
