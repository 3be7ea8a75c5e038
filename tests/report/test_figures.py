"""Figures: labelled axes with units, column width, no state left behind."""

import subprocess
import sys

import numpy as np
import pytest

from pneumo_casadi.flow import fit_polynomials
from pneumo_casadi.report.figures import figures_of
from pneumo_casadi.report.figures.flow_map import flow_map_figure, residual_map_figure
from pneumo_casadi.report.figures.style import COLUMN, MM, PAGE, png

#: Figures whose vertical axis holds names.
NAMES = {"parameters", "correlations"}


@pytest.fixture(scope="module")
def drawn(quick):
    return {item.name: item for item in figures_of(quick)}


def test_every_family_is_drawn(drawn):
    assert set(drawn) == {
        "overview",
        "parameters",
        "validation_validate[8:10 s]",
        "flow_map",
        "residual_map",
        "cross_validation_validate[8:10 s]",
        "output_error",
        "residuals",
        "correlations",
    }


def test_every_quantity_has_its_unit(drawn):
    for name, item in drawn.items():
        for axes in item.figure.axes:
            for axis in (axes.xaxis, axes.yaxis):
                label = axis.get_label_text()
                if label:
                    assert "[" in label, (name, label)
        labels = [axes.get_ylabel() for axes in item.figure.axes]
        assert any(labels) or name in NAMES, name


def test_the_lowest_panel_has_a_time_axis(drawn):
    for name in ("output_error", "validation_validate[8:10 s]"):
        assert drawn[name].figure.axes[-1].get_xlabel() == "$t$ [s]"


def test_figures_are_as_wide_as_a_column_or_the_page(drawn):
    for name, item in drawn.items():
        width = PAGE if name == "overview" else COLUMN
        assert item.figure.get_figwidth() == pytest.approx(width * MM)


def test_every_figure_has_a_caption_for_those_who_do_not_see_it(drawn):
    assert all(len(item.caption) > 20 for item in drawn.values())


def test_equal_results_give_equal_files(quick):
    first, second = (next(iter(figures_of(quick))).figure for _ in range(2))
    assert png(first) == png(second)


def test_no_figure_goes_through_pyplot():
    """Other libraries may import it, so a fresh process is asked."""
    code = (
        "import sys, pkgutil, importlib, pneumo_casadi.report.figures as f\n"
        "for m in pkgutil.iter_modules(f.__path__, f.__name__ + '.'):\n"
        "    importlib.import_module(m.name)\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_scattered_flow_map_is_drawn_too(quick):
    keep = np.arange(quick.flow_map.n) % 7 != 3
    table = quick.flow_map.select(keep)
    assert not table.is_grid
    model = fit_polynomials(table)
    assert png(flow_map_figure(table, model)).startswith(b"\x89PNG")
    assert png(residual_map_figure(table, model)).startswith(b"\x89PNG")
