"""Figures of uncertainty: profile likelihoods, correlations with their clusters together."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pneumo_casadi.estimation.statistics import interval_factor
from pneumo_casadi.estimation.uncertainty import Identifiability, Profile
from pneumo_casadi.estimation.uncertainty.profile_path import robust_ratio
from pneumo_casadi.report.figures.identification.parameters import matrix_figure
from pneumo_casadi.report.figures.style import (
    BLACK,
    GREY,
    HEAD,
    LINE,
    SIMULATED,
    TEXT,
    dress,
    legend_above,
    new_figure,
    symbol,
)

#: Panels side by side in a column.
ACROSS = 2


def profile_figure(profiles: Mapping[str, Profile]) -> Figure:
    """Draw profile likelihoods beside what the Gauss-Newton covariance says.

    Drawn is the root of twice the rise of the cost: two straight lines where the covariance is
    exact. Deviations are in Gauss-Newton standard deviations, where there are any; the interval
    lies where the profile is below the threshold: the lower one for white residuals, the upper one
    for residuals as correlated as they are. A flat profile says that the data hold nothing.
    """
    down = -(-len(profiles) // ACROSS)
    figure = new_figure(8.0 + 34.0 * down, head=HEAD)
    grid = figure.subplots(down, ACROSS, squeeze=False)
    panels = list(grid.ravel())
    for axes, profile in zip(panels, profiles.values(), strict=False):
        _draw(axes, profile)
    for axes in panels[len(profiles) :]:
        axes.set_visible(False)
    for row in grid:
        row[0].set_ylabel(r"$\sqrt{2\,\Delta\mathrm{cost}}$ [1]", fontsize=TEXT, labelpad=2)
    _legend(panels[0], next(iter(profiles.values())).level)
    return figure


def _draw(axes: Axes, profile: Profile) -> None:
    known = np.isfinite(profile.std)
    good = np.isfinite(profile.costs)
    unit = profile.std if known else 1.0
    d = (profile.values[good] - profile.estimate) / unit
    if known:
        axes.plot(d, np.abs(d), color=GREY, linewidth=2.2)
    axes.plot(
        d, np.abs(profile.root[good]), color=SIMULATED, linewidth=LINE, marker="o", markersize=2.5
    )
    white = interval_factor(profile.level)
    correlated = white * robust_ratio(profile.std, profile.std_robust)
    axes.axhline(white, color=BLACK, linewidth=0.7, linestyle=":")
    if np.isfinite(correlated):
        axes.axhline(correlated, color=BLACK, linewidth=0.7, linestyle="--")
    axes.set_ylim(bottom=0.0)
    dress(axes, f"{symbol(profile.name)}, deviation [{'std' if known else profile.unit}]")


def _legend(axes: Axes, level: float) -> None:
    """Write one legend for all panels, whatever is missing in the first."""
    kinds: tuple[tuple[str, dict[str, Any]], ...] = (
        ("Gauss-Newton", {"color": GREY, "linewidth": 2.2}),
        ("profile", {"color": SIMULATED, "linewidth": LINE, "marker": "o", "markersize": 2.5}),
        (f"{100 * level:g} %", {"color": BLACK, "linewidth": 0.7, "linestyle": ":"}),
        ("correlated", {"color": BLACK, "linewidth": 0.7, "linestyle": "--"}),
    )
    legend_above(axes, 4, [Line2D([], [], label=label, **style) for label, style in kinds])


def clustered_correlation_figure(identifiability: Identifiability) -> Figure:
    """Draw the correlations of all estimates, those of a cluster side by side."""
    first = [name for cluster in identifiability.clusters for name in cluster]
    names = [*first, *(name for name in identifiability.names if name not in first)]
    at = [identifiability.names.index(name) for name in names]
    return matrix_figure(identifiability.correlation[np.ix_(at, at)], names)
