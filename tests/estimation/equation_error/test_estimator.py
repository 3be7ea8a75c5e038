"""The equation-error estimator on axes of known truth."""

import numpy as np
import pytest

from pneumo_casadi.effects.friction.position_friction_curve import PositionFrictionCurve
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.equation_error import fit_equation_error, smooth_motion
from pneumo_casadi.estimation.flow_anchor import anchor_to_flow_map


@pytest.fixture(scope="module")
def force(made):
    """A force-driven axis of known truth and three seconds of its record."""
    axis = made.true_force_axis()
    return axis, made.recorded(axis, *made.controlled(axis, 3000))


@pytest.fixture(scope="module")
def servo(made):
    """A servo axis started from the fit of its measured map, two seconds of record, the map."""
    axis = made.true_axis()
    table = made.measured_map(0)
    flow = made.fit_polynomials(table, (3, 3, 3))
    start = made.Servosystem(made.BENCH, flow).with_parameters(made.TRUE)
    return start, made.recorded(axis, *made.controlled(axis, 2000)), table


@pytest.mark.slow
def test_a_force_axis_is_recovered_from_a_start_half_off(made, force):
    axis, record = force
    start = made.perturbed(axis, {"M": 1.5, "f_v": 0.5, "F_c_plus": 1.5, "F_c_minus": 0.5})
    result = fit_equation_error(start, [record])
    assert result.converged
    for name in ("M", "F_c_plus", "F_c_minus"):
        assert result.parameters[name].value == pytest.approx(made.FORCE_TRUE[name], rel=0.03)
    assert result.parameters["f_v"].value == pytest.approx(made.FORCE_TRUE["f_v"], abs=2.0)


@pytest.mark.slow
def test_a_servo_axis_is_recovered_with_its_flow_map(made, servo):
    start, record, table = servo
    far = made.perturbed(start, dict.fromkeys(("X_s1", "X_s2", "X_s4", "X_s5", "M"), 1.3))
    result = fit_equation_error(far, [record], table)
    assert result.converged
    for name in (*(f"X_s{i}" for i in range(1, 7)), "M"):
        assert result.parameters[name].value == pytest.approx(made.TRUE[name], rel=0.05), name
    assert set(result.std) == set(start.parameters.free_names)


@pytest.mark.parametrize("least_gain", [None, 1.0])
def test_what_only_a_prior_tells_does_not_hang_on_where_a_fit_begins(made, force, least_gain):
    _, record = force  # passes the third knot of six at most
    axis = made.true_force_axis(PositionFrictionCurve())
    outer = [f"position_friction_curve.c_plus_{i}" for i in (4, 5, 6)]
    ends = []
    for slope in (0.0, 5.0, -5.0):
        start = axis.with_parameters({name: slope * (2 + i) for i, name in enumerate(outer)})
        ends.append(fit_equation_error(start, [record], least_gain=least_gain).parameters)
    for end in ends[1:]:
        for name in outer:
            assert end[name].value == pytest.approx(ends[0][name].value, abs=1e-3), name


def test_smoothed_motions_and_an_anchor_serve_as_well_as_records_and_a_map(servo):
    start, record, table = servo
    prepared = [smooth_motion(start, record)], anchor_to_flow_map(table, start.flow)
    plain, other = fit_equation_error(start, [record], table), fit_equation_error(start, *prepared)
    np.testing.assert_array_equal(plain.parameters.values, other.parameters.values)
    np.testing.assert_array_equal(plain.residuals[0], other.residuals_of(prepared[0][0]))


def test_bounds_hold_and_what_is_fixed_stays(made, force):
    axis, record = force
    bounded = axis.parameters.with_values({"M": 22.0}).bounded("M", 20.0, 30.0).fix("f_v")
    result = fit_equation_error(axis.with_parameters(bounded), [record])
    assert result.parameters["M"].value == 20.0
    assert result.parameters["f_v"].value == made.FORCE_TRUE["f_v"] and "f_v" not in result.std


def test_twice_the_records_halve_the_variance(force):
    axis, record = force
    one, two = (fit_equation_error(axis, [record] * n) for n in (1, 2))
    np.testing.assert_allclose(two.covariance, one.covariance / 2, rtol=1e-3)


def test_the_representation_is_one_line_with_the_main_figures(force):
    axis, record = force
    text = repr(fit_equation_error(axis, [record]))
    assert text.startswith("EquationErrorResult(converged, 4 parameters, ") and len(text) < 100


def test_one_record_need_not_stand_in_a_list(force):
    axis, record = force
    alone, listed = fit_equation_error(axis, record), fit_equation_error(axis, [record])
    assert alone.axis.parameters.as_dict() == listed.axis.parameters.as_dict()


def test_nothing_to_fit_is_an_error(force):
    axis, record = force
    with pytest.raises(ModelError, match="no record"):
        fit_equation_error(axis, [])
    with pytest.raises(ModelError, match="no parameter is free"):
        fit_equation_error(axis.with_parameters(axis.parameters.fix_all()), [record])
