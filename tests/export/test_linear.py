"""Operating points are at rest; the linear axis is the tangent of the nonlinear one."""

import json
from dataclasses import replace

import numpy as np
import pytest
import scipy.io

from pneumo_casadi.data import Arrangement, NoController, PressureBench
from pneumo_casadi.errors import MissingExtraError, ModelError
from pneumo_casadi.export import linearise, operating_point, write_state_space
from pneumo_casadi.export.linear import OperatingPoint
from pneumo_casadi.model.servosystem import PressureAxis
from pneumo_casadi.model.simulation import simulate


def rates(axis, point):
    result = axis.rhs(point.x, point.u, axis.parameters.values)
    return np.asarray(result, dtype=float).ravel() / axis.state_scales


def without_position(axis, values):
    return np.delete(values, axis.states.index("x"))


@pytest.mark.parametrize("given", [{}, {"x": -0.12}, {"v": 0.2}, {"v": -0.1, "x": 0.05}])
def test_what_is_not_given_is_found_so_that_nothing_else_moves(model, given):
    axis = model.axis
    point = operating_point(axis, given)
    assert np.abs(without_position(axis, rates(axis, point))).max() < 1e-7
    by_name = dict(zip((*axis.states, *axis.inputs), (*point.x, *point.u), strict=True))
    assert all(by_name[name] == value for name, value in {"x": 0.0, "v": 0.0, **given}.items())
    if axis.kind.chambers:
        assert by_name["u_P"] == pytest.approx(-by_name["u_N"], abs=1e-9)


def test_given_commands_find_the_velocity_that_they_hold(models):
    # Narrow friction, as a fit leaves it.
    axis = models["nominal"].axis.with_parameters({"v_s": 1e-4})
    point = operating_point(axis, {"u_P": 0.3, "u_N": -0.25, "x": 0.1})
    assert np.abs(without_position(axis, rates(axis, point))).max() < 1e-7
    run = simulate(axis, np.tile(point.u, (200, 1)), 1e-3, point.x)
    # Chambers change their volume, so that nothing is steady for long; the velocity begins so.
    assert run["v"][20] == pytest.approx(point.x[3], rel=0.02) and point.x[3] > 0.1


def test_a_point_given_whole_is_taken_as_it_stands(models):
    given = {"p_P": 3e5, "p_N": 5e5, "x": 0.1, "v": 0.4, "u_P": 1.0, "u_N": -0.5}
    axis = models["effects"].axis
    point = operating_point(axis, given)
    assert point.x[:4].tolist() == [3e5, 5e5, 0.1, 0.4] and point.u.tolist() == [1.0, -0.5]
    rest = axis.rest(point.x[:4], point.u, axis.parameters.values).full().ravel()
    assert np.array_equal(point.x, rest)


def test_pressures_are_no_commands_that_oppose_each_other():
    axis = PressureAxis(PressureBench(1e3, 8.75e-4, 6.03e-4, 0.5, 1e5))
    axis = axis.with_parameters({"F_c_plus": 12.0, "F_c_minus": 12.0})
    p_P, p_N = operating_point(axis, {"p_N": 4e5, "v": 0.0}).u
    assert p_N == 4e5
    assert p_P == pytest.approx(1e5 + 6.03e-4 / 8.75e-4 * 3e5)


def test_a_measured_supply_stays_as_the_bench_has_it(made):
    supplied = made.supplied_axis()
    point = operating_point(supplied, {"x": 0.1})
    u_P, u_N, p_supply = point.u
    assert p_supply == supplied.bench.p_supply
    assert u_P == pytest.approx(-u_N, abs=1e-9)
    assert np.abs(without_position(supplied, rates(supplied, point))).max() < 1e-7


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"pressure": 1e5}, "no state or input pressure; there are p_P, p_N, x, v"),
        ({"x": np.nan}, "finite"),
        ({"p_P": 6.9e5, "p_N": 1.1e5, "v": 0.0}, "no operating point .*the rate of v"),
        ({"x": 0.9}, r"x = 0.9 m lies outside the stroke, -0.25 to 0.25 m; give"),
        ({"x": -0.9}, r"x = -0.9 m lies outside the stroke"),
        ({"u_P": 1000.0}, r"u_P = 1000 V lies outside `controller.u_max`, -3 to 3 V"),
        ({"v": 500.0}, r"operating point"),
        ({"p_P": 4.0, "v": 0.1}, r"operating point"),
        (
            {"p_P": 4.0, "p_N": 5.0, "x": 0, "v": 0, "u_P": 0, "u_N": 0},
            r"operating point: p_P = 4 Pa, far below the ambient pressure",
        ),
    ],
)
def test_a_point_that_cannot_be_is_told(models, given, message):
    with pytest.raises(ModelError, match=message):
        operating_point(models["nominal"].axis, given)


def test_commands_that_no_controller_limits_end_with_the_map(models):
    axis = models["nominal"].axis
    free = replace(axis, bench=replace(axis.bench, controller=NoController()))
    lower, upper = axis.flow.u_range
    limits = rf"u_P = 11 V lies outside the flow map, {lower:g} to {upper:g} V"
    with pytest.raises(ModelError, match=limits):
        operating_point(free, {"u_P": 11.0})


def test_a_point_that_cannot_be_is_not_linearised(models):
    axis = models["nominal"].axis
    point = operating_point(axis)
    beyond = OperatingPoint(np.where(np.arange(4) == 2, 0.9, point.x), point.u)
    with pytest.raises(ModelError, match=r"x = 0.9 m lies outside the stroke"):
        linearise(axis, beyond)


def test_the_matrices_are_those_of_finite_differences(model):
    axis, theta = model.axis, model.axis.parameters.values
    at = operating_point(axis, {"v": 0.15, "x": 0.05})
    # Off the balance, where every entry counts, and off zero commands, where the flow has a kink.
    point = OperatingPoint(at.x + 0.01 * axis.state_scales, at.u + 0.2)
    result = linearise(axis, point)
    z, nx = np.concatenate([point.x, point.u]), len(axis.states)
    scales = np.concatenate([axis.state_scales, np.ones(len(axis.inputs))])

    def value(z):
        results = [f(z[:nx], z[nx:], theta).full().ravel() for f in (axis.rhs, axis.output)]
        return np.concatenate(results)

    steps = 1e-6 * np.diag(scales)
    columns = [
        (value(z + h) - value(z - h)) / (2e-6 * s) for h, s in zip(steps, scales, strict=True)
    ]
    expected = np.array(columns).T
    full = np.block([[result.A, result.B], [result.C, result.D]])
    size = np.abs(expected).max(axis=0)
    assert np.abs((full - expected) / np.where(size > 0, size, 1.0)).max() < 1e-6


def test_small_motions_follow_the_state_space(model):
    control = pytest.importorskip("control", reason="needs the extra `export` (control)")
    axis = model.axis
    point = operating_point(axis, {"v": 0.05})
    linear = linearise(axis, point)
    system = linear.state_space()
    t = 1e-3 * np.arange(61)
    wave = 1e-4 * np.sin(2 * np.pi * 20 * t)
    du = wave[:, None] * np.array([1.0, -0.7])[: len(axis.inputs)]
    # The nonlinear axis beside itself without the wave: it moves through the stroke meanwhile.
    still, moved = (simulate(axis, point.u + w, 1e-3, point.x) for w in (0 * du, du))
    sampled = system.sample(1e-3, method="zoh")
    response = control.forced_response(sampled, t, du.T, squeeze=False)
    for name, expected in zip(axis.outputs, response.outputs, strict=True):
        computed = moved[name] - still[name]
        assert np.abs(computed - expected).max() < 0.02 * np.abs(expected).max()
    assert system.state_labels == list(linear.states) and system.input_labels == list(axis.inputs)


def test_without_control_the_extra_is_named(models, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "control", None)
    with pytest.raises(MissingExtraError, match=r"pneumo-casadi\[export\]"):
        linearise(models["force"].axis).state_space()


def test_files_hold_matrices_names_and_operating_point(models, tmp_path):
    model = replace(models["effects"], name="bench 3")
    write_state_space(model, tmp_path, {"x": 0.1})
    result = linearise(model.axis, operating_point(model.axis, {"x": 0.1}))
    told = json.loads((tmp_path / "axis_ss.json").read_text("utf-8"))
    mat = scipy.io.loadmat(tmp_path / "axis_ss.mat")
    for name in "ABCD":
        assert np.array_equal(told[name], getattr(result, name))
        assert np.array_equal(mat[name], getattr(result, name))
    assert [str(name[0][0]) for name in mat["states"]] == list(result.states)
    assert told["operating_point"]["x"][2] == 0.1 and told["name"] == "bench 3"


def test_one_valve_gives_its_chambers_opposite_commands(models):
    axis = models["nominal"].axis
    single = replace(axis, bench=replace(axis.bench, arrangement=Arrangement.ONE_5_3))
    u_P, u_N = operating_point(single, {"u_P": 0.3}).u
    assert (u_P, u_N) == pytest.approx((0.3, -0.3), abs=1e-9)
    with pytest.raises(ModelError, match="leave out u_N"):
        operating_point(single, {"u_P": 0.3, "u_N": -0.2})
