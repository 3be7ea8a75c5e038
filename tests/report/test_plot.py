"""`pc.plot`: every figure is drawn from a result, and a result without its data is refused."""

import importlib.util
import inspect
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import pneumo_casadi as pc

_spec = importlib.util.spec_from_file_location(
    "diagnoses", Path(__file__).with_name("diagnoses.py")
)
diagnoses = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(diagnoses)

FIGURES = {
    name
    for name, item in inspect.getmembers(pc.plot, inspect.isfunction)
    if item.__module__ == pc.plot.__name__ and not name.startswith("_")
}
OF_IDENTIFICATION = {
    "correlations",
    "cross_validation",
    "flow_map",
    "flow_map_residuals",
    "output_error",
    "overview",
    "parameters",
    "regressor",
    "residuals",
    "validation",
}
OF_DIAGNOSIS = {
    "dashboard",
    "discovered_term",
    "gap",
    "ranking",
    "regimes",
    "simulations",
    "unknown_inputs",
    "where",
}


def assert_drawn(figure):
    assert isinstance(figure, Figure)
    panels = [axes for axes in figure.axes if axes.get_visible()]
    assert panels and any(axes.has_data() for axes in panels)


def test_the_cases_below_are_all_figures():
    assert OF_IDENTIFICATION | OF_DIAGNOSIS | {"recording", "design", "comparison"} == FIGURES


def test_the_gallery_shows_every_figure():
    page = Path(__file__).resolve().parents[2] / "docs" / "tutorials" / "gallery.md"
    shown = re.findall(r"^pc\.plot\.(\w+)\(", page.read_text("utf-8"), re.MULTILINE)
    assert sorted(shown) == sorted(FIGURES)


@pytest.mark.parametrize("name", sorted(FIGURES))
def test_a_figure_says_what_it_shows(name):
    assert getattr(pc.plot, name).__doc__.startswith("Plot ")


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(OF_IDENTIFICATION))
def test_figures_of_an_identification(name, quick):
    assert_drawn(getattr(pc.plot, name)(quick))


@pytest.mark.parametrize("name", sorted(OF_DIAGNOSIS))
def test_figures_of_a_diagnosis(name):
    assert_drawn(getattr(pc.plot, name)(diagnoses.with_curves()))


def test_channels_of_a_recording():
    record = pc.example_case().identify[0].window(10.0, 11.0)
    figure = pc.plot.recording(record, ("x", "p_P"))
    assert_drawn(figure)
    assert [axes.get_ylabel() for axes in figure.axes] == ["$x$ [mm]", "$p_P$ [kPa]"]


def test_figure_of_a_design(made_design):
    """A design that was searched for is drawn by the command, whose test looks at the file."""
    assert_drawn(pc.plot.design(made_design()))


def test_figure_of_a_design_for_an_axis_whose_supply_is_recorded(made_design):
    made = made_design()
    run = replace(made.runs["axis"], u=np.vstack([made.runs["axis"].u, np.full(100, 7e5)]))
    assert_drawn(pc.plot.design(replace(made, runs={"axis": run})))


def test_a_validation_is_drawn_by_itself(quick):
    assert_drawn(pc.plot.validation(quick.validation))


@pytest.mark.parametrize("name", ["cross_validation", "overview", "validation"])
def test_no_held_out_record_is_an_error(name, quick):
    bare = replace(quick, predictions=(), validation=None)
    with pytest.raises(pc.errors.ModelError, match="plot"):
        getattr(pc.plot, name)(bare)


@pytest.mark.parametrize("name", ["regimes", "unknown_inputs"])
def test_a_diagnosis_without_curves_is_an_error(name):
    with pytest.raises(pc.errors.ModelError, match="curves"):
        getattr(pc.plot, name)(diagnoses.EFFECT)


def test_an_unknown_balance_is_named_with_those_that_exist():
    with pytest.raises(pc.errors.ModelError, match=r"'torque' .*force"):
        pc.plot.regimes(diagnoses.with_curves(), "torque")
