"""The most probable causes, and the share of the gap that each of them removes."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pneumo_casadi.diagnosis import Candidate, Diagnosis
from pneumo_casadi.report.figures.style import (
    BLACK,
    BLUE,
    GREY,
    REST,
    ROW,
    SMALL,
    dress,
    new_figure,
    write_at_bar,
)
from pneumo_casadi.report.tables.diagnosis import matters
from pneumo_casadi.report.tables.quantities import chance
from pneumo_casadi.report.tables.table import plain

#: Candidates drawn: those that matter up to the first number, and the first ones up to the second.
DRAWN, LEAST = 5, 3
#: Height of a line of a label [rows].
LINE = 0.62
#: Closing [%] at which the axis ends; smaller values are arrows there.
WORST = -100.0


def ranking_figure(diagnosis: Diagnosis) -> Figure:
    """Draw the first candidates: probability, and the share of the gap that each removes."""
    shown = _first(diagnosis, DRAWN)
    lines = max((_lines(candidate.label).count("\n") + 1 for candidate in shown), default=1)
    figure = new_figure(ROW * max(1.0, LINE * lines) * len(shown) + REST + 2)
    left, right = figure.subplots(1, 2, sharey=True)
    draw_ranking(left, right, diagnosis)
    return figure


def draw_ranking(left: Axes, right: Axes, diagnosis: Diagnosis, most: int = DRAWN) -> None:
    """Draw the first candidates into given axes that share their rows."""
    shown = _first(diagnosis, most)
    y = np.arange(len(shown))
    named = {effect.name for effect in diagnosis.effects}
    for i, candidate in enumerate(shown):
        colour = BLUE if set(candidate.names) == named else GREY
        left.barh(i, 100 * candidate.probability, 0.62, color=colour, zorder=2)
        write_at_bar(left, 100 * candidate.probability, i, chance(candidate.probability), colour)
        _closing(right, i, candidate, colour)
    labels = [_lines(candidate.label) for candidate in shown]
    dress(left, "probability [%]")
    dress(right, "closed in balances [%]")
    left.set_xlim(0, 104)
    closures = [candidate.closure for candidate in shown if candidate.closure is not None]
    low = min((100 * closure.lower for closure in closures), default=0.0)
    right.set_xlim(max(min(low, 0.0), WORST) - 4, 104)
    right.axvline(0, color=BLACK, linewidth=0.6, zorder=1)
    left.set_yticks(y, labels, fontsize=SMALL)
    left.set_ylim(len(shown) - 0.45, -0.55)
    for axes in (left, right):
        axes.grid(False, axis="y")
        axes.tick_params(axis="y", length=0)


def _first(diagnosis: Diagnosis, most: int) -> list[Candidate]:
    fitted = [candidate for candidate in diagnosis.ranking if not candidate.failure]
    shown = [candidate for candidate in fitted if matters(diagnosis, candidate)]
    return (shown if len(shown) >= LEAST else fitted[:LEAST])[:most]


def _closing(axes: Axes, i: int, candidate: Candidate, colour: str) -> None:
    if candidate.closure is None:
        axes.text(2, i, "not fitted", fontsize=SMALL - 0.5, va="center", color=BLACK)
        return
    closure = candidate.closure
    value, low, high = (
        max(100 * part, WORST) for part in (closure.value, closure.lower, closure.upper)
    )
    axes.hlines(i, low, high, color=colour, linewidth=2.4, zorder=2)
    marker = "o" if value > WORST else "<"
    axes.plot(value, i, marker, color=BLACK, markersize=2.6, zorder=3, clip_on=False)


def _lines(label: str) -> str:
    return plain(label).replace(" + ", " +\n")
