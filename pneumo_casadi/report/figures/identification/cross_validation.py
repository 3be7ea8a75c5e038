"""Mass flows and pressure force predicted on held-out records (Figs. 4 and 5)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pneumo_casadi.estimation.wls import Prediction
from pneumo_casadi.report.figures.style import (
    HEAD,
    LINE,
    MEASURED,
    TEXT,
    UNITS,
    WLS,
    axis_label,
    dress,
    headroom,
    legend_above,
    new_figure,
    remark,
    thin,
)


def cross_validation_figure(prediction: Prediction) -> Figure:
    """Draw measured and predicted sides of each balance over time; no prediction at rest."""
    names = list(prediction.measured)
    figure = new_figure(20.0 + 30.0 * len(names), head=HEAD)
    axes_of = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(axes_of, names, strict=True):
        draw_sides(axes, prediction, name, "predicted by WLS")
        headroom(axes)
        remark(axes, f"relative error {prediction.relative_error_percent[name]:.2g} %")
    legend_above(axes_of[0], 2)
    axes_of[-1].set_xlabel("$t$ [s]", fontsize=TEXT)
    figure.align_ylabels()
    return figure


def draw_sides(axes: Axes, prediction: Prediction, name: str, label: str) -> None:
    """Draw both sides of one balance into given axes."""
    text, factor = axis_label(name, UNITS[name])
    # Samples at rest do not count: friction at rest is no function of the velocity.
    counted = np.where(prediction.used[name], prediction.predicted[name], np.nan)
    t, y, y_hat = thin(prediction.t, prediction.measured[name], counted)
    axes.plot(t, y * factor, color=MEASURED, linewidth=2.2, label="measured")
    axes.plot(t, y_hat * factor, color=WLS, linewidth=LINE, label=label)
    dress(axes, None, text)
