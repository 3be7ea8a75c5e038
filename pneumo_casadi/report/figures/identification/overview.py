"""The result in one picture: flow map, prediction of a held-out record, parameters."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pneumo_casadi.identification.result import Identification
from pneumo_casadi.report.figures.identification.parameters import draw_forest
from pneumo_casadi.report.figures.style import (
    BLUE,
    CLOSED,
    HEAD,
    LINE,
    MEASURED,
    PAGE,
    SIMULATED,
    axis_label,
    block_means,
    dress,
    legend_above,
    new_figure,
    thin,
)
from pneumo_casadi.report.figures.time_series import AVERAGED
from pneumo_casadi.validation.validate import Run
from pneumo_casadi.valve import FlowMap, FlowModel, each_valve

#: Commands whose flow is drawn.
CURVES = 7


def overview_figure(identification: Identification) -> Figure:
    """Draw flow map, held-out position and parameters of a servo axis side by side."""
    table, flow, validation = (
        identification.flow_map,
        identification.flow,
        identification.validation,
    )
    assert table is not None and flow is not None and validation is not None
    figure = new_figure(66.0, PAGE, HEAD)
    grid = figure.add_gridspec(2, 3, width_ratios=(0.85, 1.25, 1.05), height_ratios=(2, 1))
    _flow(figure.add_subplot(grid[:, 0]), *next(iter(each_valve(table, flow).values())))
    above = figure.add_subplot(grid[0, 1])
    _position(above, figure.add_subplot(grid[1, 1], sharex=above), validation.runs[0])
    draw_forest(figure.add_subplot(grid[:, 2]), identification)
    return figure


def _flow(axes: Axes, table: FlowMap, model: FlowModel) -> None:
    commands = np.unique(table.u)
    chosen = commands[np.linspace(0, commands.size - 1, CURVES).round().astype(int)]
    p = np.linspace(*table.p_range, 200)
    for command in np.unique(chosen):
        at = table.u == command
        fitted, metered = ("fitted", "measured") if command == chosen[0] else (None, None)
        axes.plot(p * 1e-3, model(command, p) * 1e3, color=BLUE, linewidth=LINE, label=fitted)
        axes.plot(
            table.p[at] * 1e-3, table.q_m[at] * 1e3, "o", color=MEASURED, markersize=2.6,
            markeredgewidth=0, zorder=1.8, label=metered,
        )  # fmt: skip
    dress(axes, "$p$ [kPa]", "$q_m(u, p)$ [g/s]")
    legend_above(axes, 2)


def _position(above: Axes, below: Axes, run: Run) -> None:
    label, factor = axis_label("x", "m")
    t, x = thin(run.record.t, run.record["x"])
    above.plot(t, x * factor, color=MEASURED, linewidth=2.2, label="held out")
    runs = [("open loop", run.open_loop, SIMULATED, "-")]
    if run.closed_loop is not None:
        runs.append(("closed loop", run.closed_loop, CLOSED, "--"))
    for text, trajectory, colour, dashes in runs:
        _, simulated = thin(run.record.t, trajectory["x"])
        above.plot(t, simulated * factor, dashes, color=colour, linewidth=LINE, label=text)
        e = run.record["x"] - trajectory["x"]
        time, mean = block_means(run.record.t, e, AVERAGED)
        below.plot(time, mean * factor, color=colour, linewidth=LINE)
    above.tick_params(labelbottom=False)
    dress(above, None, label)
    dress(below, "$t$ [s]", "error [mm]")
    legend_above(above, 3)
