"""Figures of a diagnosis are legible and show what was found."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pneumo_casadi.diagnosis import Verdict
from pneumo_casadi.diagnosis.metrics.findings import Closure
from pneumo_casadi.report.figures.diagnosis.dashboard import dashboard_figure
from pneumo_casadi.report.figures.diagnosis.gap import gap_figure
from pneumo_casadi.report.figures.diagnosis.ranking import ranking_figure
from pneumo_casadi.report.figures.style import COLUMN, MM, PAGE
from pneumo_casadi.report.text.diagnosis import (
    headline,
)

_spec = importlib.util.spec_from_file_location(
    "diagnoses", Path(__file__).with_name("diagnoses.py")
)
made = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(made)

_SIZES = "added by the effects [% of the balance's signal]"


def test_a_candidate_far_worse_than_none_is_an_arrow_at_the_edge():
    first = replace(made.EFFECT.ranking[0], closure=Closure(-3.2, -4.0, -2.5))
    figure = ranking_figure(replace(made.EFFECT, ranking=(first, *made.EFFECT.ranking[1:])))
    axes = figure.axes[1]
    arrow = next(line for line in axes.lines if line.get_marker() == "<")
    assert axes.get_xlim()[0] < arrow.get_xdata()[0] == -100
    assert all(axes.get_xlim()[0] <= x for line in axes.lines for x in line.get_xdata())


@pytest.mark.slow
def test_figures_are_as_wide_as_a_column_and_carry_units(drawn):
    assert set(drawn) == {
        *("gap", "ranking", "where", "unknown_inputs", "regimes_force", "dashboard"),
        *("discovered_term", "validation_held_out"),
    }
    for name, drawing in drawn.items():
        width = PAGE if name in ("dashboard", "validation_held_out") else COLUMN
        assert drawing.figure.get_figwidth() == pytest.approx(width * MM), name
        assert len(drawing.caption) > 60
        labels = [axes.get_xlabel() for axes in drawing.figure.axes] + [
            axes.get_ylabel() for axes in drawing.figure.axes
        ]
        assert all("[" in label for label in labels if label), (name, labels)


def test_bars_show_the_gap_before_and_after(drawn):
    first = drawn["gap"].figure.axes[0]
    widths = [bar.get_width() for container in first.containers for bar in container]
    assert widths == pytest.approx([10.0, 12.5, 15.0, 0.5, 0.625, 0.75])


def test_the_dashboard_says_the_verdict_and_shows_what_there_is(drawn):
    figure = drawn["dashboard"].figure
    assert figure.texts[0].get_text().replace("\n", " ") == headline(made.EFFECT)
    labels = [axes.get_xlabel() for axes in figure.axes]
    assert labels[1:] == [*("probability [%]", "closed in balances [%]", _SIZES, "$t$ [s]")]
    without = dashboard_figure(made.EFFECT)
    assert without.axes[-1].get_xlabel() == "share [%]"  # regimes where there are no curves


@pytest.mark.slow
@pytest.mark.parametrize("verdict", [Verdict.AMBIGUOUS, Verdict.UNKNOWN])
def test_the_headline_of_a_dashboard_stays_on_it(verdict):
    changed = replace(made.ALL[verdict], evidence=made.evidence())
    figure = dashboard_figure(changed)
    figure.draw_without_rendering()
    text, legend = figure.texts[0].get_window_extent(), figure.axes[0].get_legend()
    assert text.x0 > 0 and text.x1 < figure.bbox.x1 and text.y1 < figure.bbox.y1
    assert text.y0 > legend.get_window_extent().y1


@pytest.mark.slow
@pytest.mark.parametrize("verdict", [Verdict.EFFECT, Verdict.UNKNOWN])
def test_the_legend_of_the_gap_stays_on_the_figure(verdict):
    figure = gap_figure(made.ALL[verdict])
    figure.draw_without_rendering()
    legend = figure.axes[0].get_legend().get_window_extent()
    assert legend.x0 > 0 and legend.x1 < figure.bbox.x1 and legend.y1 < figure.bbox.y1


def test_while_the_axis_sticks_no_unknown_force_is_drawn(drawn):
    force = drawn["unknown_inputs"].figure.axes[-1]
    curve = next(line for line in force.lines if line.get_xdata().size == 200)
    assert np.flatnonzero(np.isnan(curve.get_ydata())).tolist() == list(range(40, 60))
    assert max(np.abs(force.get_ylim())) < 20.0  # bands of nothing do not set the scale
