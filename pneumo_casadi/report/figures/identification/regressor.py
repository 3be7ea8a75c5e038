"""The fit of the regressor: measured sides of the balances, W X and what is left."""

import numpy as np
from matplotlib.figure import Figure

from pneumo_casadi.data import Recording
from pneumo_casadi.estimation.wls import WLSResult, cross_validate
from pneumo_casadi.report.figures.identification.cross_validation import draw_sides
from pneumo_casadi.report.figures.style import (
    BLACK,
    HEAD,
    LINE,
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

#: Part of a record that a figure shows [s]: more would be a band of ink, and filtered once more.
LONGEST = 100.0


def regressor_figure(result: WLSResult, record: Recording) -> Figure:
    """Draw Y, W X̂ and ρ = Y - W X̂ of each balance (eq. 13) on a record of the fit.

    The band is ±2σ of the balance's residuals, by which its rows are weighted. Of a record longer
    than `LONGEST` the beginning is drawn.
    """
    if record.duration > LONGEST:
        record = record.window(record.t[0], record.t[0] + LONGEST)
    (fit,) = cross_validate(result, record)
    names = list(fit.measured)
    figure = new_figure(18.0 + 36.0 * len(names), head=HEAD)
    panels = figure.subplots(
        2 * len(names), 1, sharex=True, squeeze=False, height_ratios=[2, 1.2] * len(names)
    )[:, 0]
    for name, above, below in zip(names, panels[::2], panels[1::2], strict=True):
        draw_sides(above, fit, name, r"$W\,\hat X_s$")
        headroom(above)
        remark(above, f"relative error {fit.relative_error_percent[name]:.2g} %")
        label, factor = axis_label(r"$\rho$", UNITS[name])
        rho = np.where(fit.used[name], fit.measured[name] - fit.predicted[name], np.nan)
        t, rho = thin(fit.t, rho * factor)
        band = 2 * result.fit.residual_std[name] * factor
        below.axhspan(-band, band, color="#dddddd", linewidth=0, zorder=0.5)
        below.axhline(0.0, color=BLACK, linewidth=0.5, zorder=1)
        below.plot(t, rho, color=WLS, linewidth=LINE)
        dress(below, None, label)
    legend_above(panels[0], 2)
    panels[-1].set_xlabel("$t$ [s]", fontsize=TEXT)
    figure.align_ylabels()
    return figure
