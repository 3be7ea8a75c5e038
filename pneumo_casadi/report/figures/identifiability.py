"""Figures of uncertainty: profile likelihoods, correlations with their clusters together."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pneumo_casadi.report.figures.parameters import matrix_figure
from pneumo_casadi.report.figures.style import (
    BLACK,
    GREY,
    HEAD,
    LINE,
    SIMULATED,
    SYMBOLS,
    dress,
    legend_above,
    new_figure,
)
from pneumo_casadi.statistics import interval_factor
from pneumo_casadi.uncertainty import Identifiability, Profile

#: Panels side by side in a column.
ACROSS = 2


def profile_figure(profiles: Mapping[str, Profile]) -> Figure:
    """Draw profile likelihoods beside the parabolas of the Gauss-Newton covariance.

    Deviations are in Gauss-Newton standard deviations, where there are any; the interval lies
    where the profile is below the threshold. A flat profile says that the data hold nothing.
    """
    down = -(-len(profiles) // ACROSS)
    figure = new_figure(8.0 + 34.0 * down, head=HEAD)
    grid = figure.subplots(down, ACROSS, squeeze=False)
    panels = list(grid.ravel())
    for axes, profile in zip(panels, profiles.values(), strict=False):
        _draw(axes, profile)
    for axes in panels[len(profiles) :]:
        axes.set_visible(False)
    legend_above(panels[0], 3)
    return figure


def _draw(axes: Axes, profile: Profile) -> None:
    known = np.isfinite(profile.std)
    good = np.isfinite(profile.costs)
    unit = profile.std if known else 1.0
    d = (profile.values[good] - profile.estimate) / unit
    rise = profile.root[good] ** 2
    symbol = SYMBOLS.get(profile.name, profile.name)
    if known:
        line = np.linspace(d.min(), d.max(), 60)
        axes.plot(line, line**2, color=GREY, linewidth=LINE, label="Gauss-Newton")
    axes.plot(d, rise, color=SIMULATED, linewidth=LINE, marker="o", markersize=2.5, label="profile")
    axes.axhline(
        interval_factor(profile.level) ** 2, color=BLACK, linewidth=0.6, linestyle="--",
        label=f"{100 * profile.level:g} %",
    )  # fmt: skip
    dress(
        axes,
        f"{symbol}, deviation [std]" if known else f"{symbol}, deviation [{profile.unit}]",
        "2 Δcost [1]",
    )


def clustered_correlation_figure(found: Identifiability) -> Figure:
    """Draw the correlations of all estimates, those of a cluster side by side."""
    first = [name for cluster in found.clusters for name in cluster]
    names = [*first, *(name for name in found.names if name not in first)]
    at = [found.names.index(name) for name in names]
    return matrix_figure(found.correlation[np.ix_(at, at)], names)
