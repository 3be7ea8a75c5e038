"""A vertical axis whose load bench.json does not state: what of the load can be estimated."""

from dataclasses import replace

import pytest

import pneumo_casadi as pc
from pneumo_casadi.data import Load
from pneumo_casadi.errors import FitError
from pneumo_casadi.estimation.wls import fit_wls
from pneumo_casadi.identification.flow_form import read_flow
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.starting_axis import axis_for_wls, axis_of_options
from pneumo_casadi.virtual_bench import Laboratory, make_case, random_axis

MASS, GRAVITY = 10.0, 9.80665


@pytest.fixture(scope="module")
def vertical(tmp_path_factory):
    """Case without its load, and the truth."""
    axis = replace(random_axis(18), M=MASS)
    folder = tmp_path_factory.mktemp("vertical") / "case"
    made = make_case(
        folder, 18, fs=1000.0, duration=5.0, axis=axis, laboratory=Laboratory(angle_deg=90.0)
    )
    case = pc.read_case(folder)
    return replace(case, bench=replace(case.bench, load=Load())), made.axis.truth


def estimates(case, **chosen):
    options = IdentifyOptions(**chosen)
    axis = axis_of_options(case, read_flow(case, options)[1], options)
    return fit_wls(axis_for_wls(axis, options), case.identify).parameters


@pytest.mark.slow
def test_the_load_is_estimated_where_one_side_of_the_friction_is_known(vertical):
    case, truth = vertical
    fixed = {"F_c_minus": truth["F_c_minus"]}
    parameters = estimates(case, effects=("constant_force",), fixed=fixed)
    assert parameters["constant_force.F_0"].value == pytest.approx(-MASS * GRAVITY, rel=0.02)
    assert parameters["M"].value == pytest.approx(MASS, rel=0.02)


def test_without_it_half_the_difference_of_the_friction_is_the_load_and_its_asymmetry(vertical):
    case, truth = vertical
    parameters = estimates(case)
    plus, minus = (parameters[name].value for name in ("F_c_plus", "F_c_minus"))
    asymmetry = (truth["F_c_minus"] - truth["F_c_plus"]) / 2
    assert minus < 0
    assert (minus - plus) / 2 == pytest.approx(asymmetry - MASS * GRAVITY, rel=0.02)
    assert parameters["M"].value == pytest.approx(MASS, rel=0.02)


def test_the_load_and_both_sides_of_the_friction_together_are_refused_with_the_remedy(vertical):
    words = r"Hold 1 of F_c_plus, F_c_minus, constant_force\.F_0 \(`--fix NAME=VALUE`\)"
    with pytest.raises(FitError, match=words):
        estimates(vertical[0], effects=("constant_force",))
