"""A diagnosis in one picture: verdict, gap, causes, affected balances."""

import textwrap

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pneumo_casadi.diagnosis import Diagnosis, Where
from pneumo_casadi.report.figures.diagnosis.gap import draw_gap, gap_legend
from pneumo_casadi.report.figures.diagnosis.ranking import draw_ranking
from pneumo_casadi.report.figures.diagnosis.unknown_inputs import draw_unknown_input
from pneumo_casadi.report.figures.diagnosis.where import draw_location, draw_regimes
from pneumo_casadi.report.figures.style import HEAD, PAGE, SMALL, TEXT, new_figure
from pneumo_casadi.report.tables.diagnosis import VIEWS, gap_models
from pneumo_casadi.report.tables.table import plain
from pneumo_casadi.report.text.diagnosis import headline

#: Letters in a line of the headline, height of a line and of both rows of panels [mm].
LETTERS, LINE_HEIGHT, ROWS = 112, 3.8, 88.0
#: Candidates and regimes shown.
CAUSES, REGIMES = 6, 3


def dashboard_figure(diagnosis: Diagnosis) -> Figure:
    """Draw the verdict, the gap, the first causes and the most affected balance."""
    lines = textwrap.wrap(headline(diagnosis), LETTERS, break_on_hyphens=False)
    top = LINE_HEIGHT * len(lines) + 1.0
    height = ROWS + top + HEAD
    figure = new_figure(height, PAGE, top + HEAD)
    text = figure.text(
        0.006, 1 - 1.0 / height, "\n".join(lines), fontsize=TEXT, fontweight="bold", va="top"
    )
    text.set_in_layout(False)
    grid = figure.add_gridspec(2, 3, width_ratios=(1.15, 1, 0.8), height_ratios=(1.1, 1))
    gap = figure.add_subplot(grid[0, 0])
    view = next(name for name in (*VIEWS, *diagnosis.gap.views) if name in diagnosis.gap.views)
    models = gap_models(diagnosis)
    draw_gap(gap, view, diagnosis.gap.views[view], models)
    gap_legend(gap, models)
    left = figure.add_subplot(grid[0, 1])
    right = figure.add_subplot(grid[0, 2], sharey=left)
    right.tick_params(labelleft=False)
    draw_ranking(left, right, diagnosis, CAUSES)
    draw_location(figure.add_subplot(grid[1, 0]), diagnosis.where)
    _details(figure.add_subplot(grid[1, 1:]), diagnosis)
    return figure


def most_affected(where: Where) -> str:
    """Return the balance that is named first; where that is a sensor, the one it shows in most."""
    named = [location.value for location in where.balances if location.value in where.shares]
    return named[0] if named else max(where.shares, key=lambda name: where.shares[name])


def _details(axes: Axes, diagnosis: Diagnosis) -> None:
    """Draw the unknown input of the most affected balance, or without curves the conditions."""
    first = most_affected(diagnosis.where)
    if diagnosis.evidence is not None and diagnosis.evidence.inputs:
        draw_unknown_input(axes, diagnosis.evidence.inputs[0], first)
        axes.set_xlabel("$t$ [s]", fontsize=TEXT, labelpad=2)
        title = f"unknown input of the {plain(first)} balance, ±2σ"
        axes.set_title(title, fontsize=SMALL, pad=2)
    elif diagnosis.where.regimes:
        draw_regimes(axes, diagnosis.where.regimes[:REGIMES])
        legend = axes.get_legend()
        assert legend is not None
        legend.set_in_layout(True)  # there are other panels above it
    else:
        axes.set_visible(False)
