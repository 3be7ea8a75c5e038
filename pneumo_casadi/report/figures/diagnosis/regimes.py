"""Regime maps: a balance's residual over command, velocity, position, pressure and time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pneumo_casadi.diagnosis.locate.regime_maps import RegimeMap
from pneumo_casadi.report.figures.style import (
    BLACK,
    HEAD,
    TEXT,
    dress,
    legend_above,
    new_figure,
)
from pneumo_casadi.report.interactive.look import COLOURS

#: Quantities on the horizontal axis: symbol, unit, factor from SI.
_QUANTITIES = {
    "u": (r"$u_0$", "V", 1.0),
    "p": (r"$p_0$", "kPa", 1e-3),
    "F": (r"$F$", "N", 1.0),
    "v": (r"$\dot x$", "mm/s", 1e3),
    "x": (r"$x$", "mm", 1e3),
    "t": (r"$t$", "s", 1.0),
}
#: Unit of a residual as it is shown, and the factor from SI.
_RESIDUALS = {"N": ("N", 1.0), "Pa/s": ("kPa/s", 1e-3), "m/s2": ("m/s²", 1.0)}
_COLUMNS = 2


def regime_figure(
    before: Sequence[RegimeMap],
    after: Sequence[RegimeMap] = (),
    labels: Sequence[str] = ("without effects", "with effects"),
) -> Figure:
    """Draw one balance's residual over all quantities.

    Parameters
    ----------
    before, after : sequence of RegimeMap
        Of one balance, without effects and with them; `after` may be empty.
    labels : sequence of str, optional
        What either model is called.
    """
    rows = -(-len(before) // _COLUMNS)
    figure = new_figure(8.0 + 29.0 * rows, head=HEAD)
    panels = figure.subplots(rows, _COLUMNS, sharey=True, squeeze=False)
    unit, factor = _RESIDUALS[before[0].residual_unit]
    with_effects = {regime_map.name: regime_map for regime_map in after}
    flat = panels.ravel()
    for axes, regime_map in zip(flat, before, strict=False):
        _steps(axes, regime_map, factor, COLOURS[1], labels[0])
        if regime_map.name in with_effects:
            _steps(axes, with_effects[regime_map.name], factor, COLOURS[2], labels[1])
        axes.axhline(0, color=BLACK, linewidth=0.5, zorder=1)
        dress(axes, quantity_label(regime_map.name))
    for axes in flat[len(before) :]:
        axes.set_axis_off()
    for row in panels:
        row[0].set_ylabel(f"residual [{unit}]", fontsize=TEXT, labelpad=2)
    legend_above(flat[0], 2)
    figure.align_ylabels()
    return figure


def quantity_label(name: str) -> str:
    """Return the label of a quantity with its display unit.

    Examples
    --------
    >>> quantity_label("u_P")
    '$u_P$ [V]'
    """
    symbol, unit, _ = _QUANTITIES[name[0]]
    return f"{symbol.replace('_0', '_' + name[-1])} [{unit}]"


def _steps(axes: Axes, regime_map: RegimeMap, factor: float, colour: str, label: str) -> None:
    edges = regime_map.edges * _QUANTITIES[regime_map.name[0]][2]
    mean, band = regime_map.mean * factor, regime_map.band * factor
    low, high = (np.append(side, side[-1]) for side in (mean - band, mean + band))
    axes.fill_between(edges, low, high, step="post", color=colour, alpha=0.3, linewidth=0)
    axes.stairs(mean, edges, color=colour, linewidth=1.0, baseline=None, label=label, zorder=3)
