"""The static flow map: surface and projections (Fig. 2), residuals of its form (Fig. 3)."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from pneumo_casadi.report.figures.style import (
    BLUE,
    LINE,
    MEASURED,
    SMALL,
    TEXT,
    dress,
    new_figure,
)
from pneumo_casadi.valve import FlowMap, FlowModel, Projections, map_residuals, project_flow_map

G_PER_S, KPA = 1e3, 1e-3
#: Curves in a projection.
CURVES = 9


def flow_map_figure(table: FlowMap, model: FlowModel) -> Figure:
    """Draw the flow map as a surface and in its three projections (Fig. 2).

    Points of the table are grey dots, the fitted form is drawn in lines.
    """
    measured = project_flow_map(table) if table.is_grid else None
    fine = _on_grid(table, model)
    figure = new_figure(108.0)
    grid = figure.add_gridspec(2, 2)
    # The layout engine would leave most of the quarter empty around a cube.
    surface = figure.add_axes((0.035, 0.53, 0.44, 0.46), projection="3d", in_layout=False)
    _surface(surface, fine)
    _flow_against_pressure(figure.add_subplot(grid[0, 1]), measured, model, table)
    _flow_against_command(figure.add_subplot(grid[1, 0]), measured, model, table)
    _pressure_gain(figure.add_subplot(grid[1, 1]), measured, fine)
    return figure


def residual_map_figure(table: FlowMap, model: FlowModel) -> Figure:
    """Draw measured minus fitted flow over the map (Fig. 3)."""
    residuals = map_residuals(table, model)
    figure = new_figure(60.0)
    axes = figure.add_subplot()
    limit = float(np.abs(residuals.residual).max()) * G_PER_S
    norm = Normalize(-limit, limit)
    if table.is_grid:
        u, p, _ = table.grid()
        order = np.lexsort((residuals.p, residuals.u))
        values = residuals.residual[order].reshape(u.size, p.size).T * G_PER_S
        axes.pcolormesh(u, p * KPA, values, norm=norm, cmap="PuOr", shading="nearest")
    else:
        values = residuals.residual * G_PER_S
        axes.scatter(residuals.u, residuals.p * KPA, 6, values, norm=norm, cmap="PuOr")
    bar = figure.colorbar(ScalarMappable(norm, "PuOr"), ax=axes, pad=0.02)
    bar.set_label(r"measured − fitted $q_m$ [g/s]", fontsize=TEXT)
    bar.ax.tick_params(labelsize=SMALL, width=0.6, length=2.5)
    dress(axes, "$u$ [V]", "$p$ [kPa]")
    axes.set_title(
        f"rms {residuals.rms_percent:.2g} %, largest {residuals.max_percent:.2g} % "
        "of the largest flow",
        fontsize=TEXT,
    )
    return figure


def _on_grid(table: FlowMap, model: FlowModel) -> Projections:
    u = np.linspace(*table.u_range, 61)
    p = np.linspace(*table.p_range, 61)
    U, P = np.meshgrid(u, p, indexing="ij")
    flow = FlowMap(U.ravel(), P.ravel(), model(U, P).ravel(), table.p_supply, table.p_ext)
    return project_flow_map(flow)


def _surface(axes: Any, fine: Projections) -> None:
    U, P = np.meshgrid(fine.u, fine.p * KPA, indexing="ij")
    axes.plot_surface(
        U, P, fine.q_m * G_PER_S, cmap="viridis", rstride=3, cstride=3, linewidth=0.2,
        edgecolor="#ffffff60",
    )  # fmt: skip
    axes.tick_params(labelsize=SMALL - 1, pad=-2)
    axes.set_xlabel("$u$ [V]", fontsize=SMALL, labelpad=-5)
    axes.set_ylabel("$p$ [kPa]", fontsize=SMALL, labelpad=-5)
    axes.zaxis.set_rotate_label(False)  # by itself it stands on its head
    axes.set_zlabel("$q_m$ [g/s]", fontsize=SMALL, labelpad=-9, rotation=90)
    axes.view_init(elev=24, azim=-132)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(4))
    axes.set_box_aspect((1, 1, 0.85), zoom=0.86)


def _flow_against_pressure(
    axes: Axes, measured: Projections | None, model: FlowModel, table: FlowMap
) -> None:
    fine = np.linspace(*table.p_range, 200)
    commands = measured.u if measured is not None else np.linspace(*table.u_range, CURVES)
    for i in _chosen(commands.size):
        axes.plot(fine * KPA, model(commands[i], fine) * G_PER_S, color=BLUE, linewidth=LINE)
        if measured is not None:
            _dots(axes, measured.p * KPA, measured.q_m[i] * G_PER_S)
    dress(axes, "$p$ [kPa]", "$q_m$ [g/s]")
    span = f"$u$ = {commands[0]:g} … {commands[-1]:g} V".replace("-", "−")
    axes.set_title(span, fontsize=SMALL, pad=2)


def _flow_against_command(
    axes: Axes, measured: Projections | None, model: FlowModel, table: FlowMap
) -> None:
    fine = np.linspace(*table.u_range, 201)
    pressures = measured.p if measured is not None else np.linspace(*table.p_range, CURVES)
    for j in _chosen(pressures.size, 6):
        axes.plot(fine, model(fine, pressures[j]) * G_PER_S, color=BLUE, linewidth=LINE)
        if measured is not None:
            _dots(axes, measured.u, measured.q_m[:, j] * G_PER_S)
    dress(axes, "$u$ [V]", "$q_m$ [g/s]")
    span = f"{pressures[0] * KPA:g} … {pressures[-1] * KPA:g} kPa"
    axes.set_title(f"$p$ = {span}", fontsize=SMALL, pad=2)


def _pressure_gain(axes: Axes, measured: Projections | None, fine: Projections) -> None:
    axes.plot(fine.u, fine.p_closed * KPA, color=BLUE, linewidth=LINE, label="fitted")
    if measured is not None:
        _dots(axes, measured.u, measured.p_closed * KPA, "measured")
    dress(axes, "$u$ [V]", "$p$ [kPa]")
    axes.set_title("closed outlet, $q_m$ = 0", fontsize=SMALL, pad=2)
    # Left of the steep curve at null, where nothing is drawn.
    axes.legend(
        fontsize=SMALL, loc="center left", frameon=False, handlelength=0.5, handletextpad=0.2,
        borderaxespad=0.1, borderpad=0.1,
    )  # fmt: skip


def _chosen(n: int, curves: int = CURVES) -> list[int]:
    return sorted({round(i) for i in np.linspace(0, n - 1, min(n, curves))})


def _dots(axes: Axes, x: Any, y: Any, label: str | None = None) -> None:
    # Behind the curves and wider than they are, as all that is measured.
    axes.plot(x, y, "o", color=MEASURED, markersize=2.6, markeredgewidth=0, zorder=1.8, label=label)
