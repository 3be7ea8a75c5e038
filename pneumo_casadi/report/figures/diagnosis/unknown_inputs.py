"""Unknown inputs of the balances over time."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pneumo_casadi.diagnosis.locate.unknown_inputs import UnknownInputs
from pneumo_casadi.report.figures.style import (
    BLACK,
    BLUE,
    DISPLAY,
    SKY,
    TEXT,
    UNITS,
    dress,
    headroom,
    new_figure,
    remark,
    thin,
)

_LETTERS = {"mass_flow_P": r"$w_P$", "mass_flow_N": r"$w_N$", "force": r"$w_F$"}


def unknown_input_figure(inputs: UnknownInputs, sizes: Mapping[str, float]) -> Figure:
    """Draw the unknown input of each balance, with a band of ±2σ and its size.

    Parameters
    ----------
    inputs : UnknownInputs
        Of one record.
    sizes : mapping of str to float
        Root mean square over the signal of each balance [1], written into its panel.
    """
    n = len(inputs.equations)
    figure = new_figure(10.0 + 27.0 * n)
    panels = figure.subplots(n, 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(panels, inputs.equations, strict=True):
        draw_unknown_input(axes, inputs, name, sizes.get(name))
    panels[-1].set_xlabel("$t$ [s]", fontsize=TEXT, labelpad=2)
    figure.align_ylabels()
    return figure


def draw_unknown_input(
    axes: Axes, inputs: UnknownInputs, name: str, size: float | None = None
) -> None:
    """Draw the unknown input of a balance into given axes, with its band and size."""
    i = inputs.equations.index(name)
    unit, factor = DISPLAY[UNITS[name]]
    counts = inputs.counts[i]
    shown = counts if counts.any() else ~counts
    # While the axis sticks there is nothing to show.
    w, band = (np.where(shown, part, np.nan) * factor for part in (inputs.w[i], 2 * inputs.std[i]))
    t, w, band = thin(inputs.t, w, band)
    axes.fill_between(t, w - band, w + band, color=SKY, alpha=0.6, linewidth=0, zorder=1.5)
    axes.plot(t, w, color=BLUE, linewidth=0.6, zorder=2)
    axes.axhline(0, color=BLACK, linewidth=0.5, zorder=1.8)
    low, high = float(np.nanmin(w - band)), float(np.nanmax(w + band))
    margin = 0.05 * max(high - low, 1e-12)
    axes.set_ylim(low - margin, high + margin)
    if not counts.all():
        axes.fill_between(
            inputs.t, 0, 1, where=~counts, color="#dddddd", linewidth=0, zorder=1.7,
            transform=axes.get_xaxis_transform(),
        )  # fmt: skip
    dress(axes, None, f"{_LETTERS[name]} [{unit}]")
    axes.set_xlim(float(inputs.t[0]), float(inputs.t[-1]))
    if size is not None:
        headroom(axes)
        remark(axes, f"{100 * size:.2g} % of the balance's signal")
