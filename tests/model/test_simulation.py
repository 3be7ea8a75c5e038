"""Simulations refuse arguments that do not fit, and states that no axis can have."""

from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.errors import ModelError
from pneumo_casadi.identification import trajectory_file
from pneumo_casadi.model.simulation import run_open_loop, simulate, simulate_closed_loop
from pneumo_casadi.model.validity.physical_range import position_limits, require_physical

DT, N = 1e-3, 20
X_0 = [4e5, 5e5, 0.0, 0.0]
CLOSED = np.zeros((N, 2))


class Times(dict):
    """Stands for a record of which only the time is read."""

    t = property(lambda self: self["t"])


@pytest.fixture(scope="module")
def axis(made):
    return made.true_axis()


@pytest.mark.parametrize("dt", [0.0, -1e-3, np.nan, np.inf])
def test_a_sampling_period_that_is_not_positive_is_refused_in_both_loops(axis, dt):
    with pytest.raises(ModelError, match=rf"dt: {dt} s; give the sampling period as a positive"):
        simulate(axis, CLOSED, dt, X_0)
    with pytest.raises(ModelError, match=rf"dt: {dt} s; give the sampling period as a positive"):
        simulate_closed_loop(axis, np.zeros(N), dt, X_0)


@pytest.mark.parametrize(
    ("x_0", "message"),
    [
        ([4, 5, 0, 0], r"x_0: p_P = 4 Pa, far below the ambient pressure .*; give absolute"),
        ([4e5, -5e5, 0, 0], r"x_0: p_N = -500000 Pa, far below"),
        ([4e5, 5e5, 5.0, 0], r"x_0: x = 5 m, where chamber N has no volume: both have one betw"),
        ([4e5, 5e5, -0.9, 0], r"x_0: x = -0.9 m, where chamber P has no volume"),
        ([4e5, np.nan, 0, 0], r"x_0: p_N = nan Pa; give finite numbers"),
        ([4e5, 5e5, 0], r"x_0: shape \(3,\), expected one value each of p_P, p_N, x, v"),
        ([X_0], r"x_0: shape \(1, 4\), expected one value each"),
    ],
)
def test_an_initial_state_that_no_axis_has_is_refused_in_both_loops(axis, x_0, message):
    with pytest.raises(ModelError, match=message):
        simulate(axis, CLOSED, DT, x_0)
    with pytest.raises(ModelError, match=message):
        simulate_closed_loop(axis, np.zeros(N), DT, x_0)


def test_a_piston_driven_through_the_end_of_its_stroke_is_refused_with_its_time(axis):
    u = np.tile([2.0, -2.0], (1000, 1))
    lower, upper = position_limits(axis.kind, axis.parameters)
    x = run_open_loop(axis, u, DT, np.array(X_0))["x"]
    k = int(np.argmax((x <= lower) | (x >= upper)))
    assert k > 0
    with pytest.raises(ModelError, match=rf"\(sample {k}\): x = .* m, where chamber N has no"):
        simulate(axis, u, DT, X_0)
    with pytest.raises(ModelError, match=r"the simulation at t = .* has no volume.*; keep the"):
        simulate_closed_loop(axis, np.full(3000, 5.0), DT, X_0)


def test_a_simulated_record_is_not_written_with_a_piston_beyond_its_stroke(axis, monkeypatch):
    run = run_open_loop(axis, np.tile([2.0, -2.0], (1000, 1)), DT, np.array(X_0))
    monkeypatch.setattr(trajectory_file, "free_run", lambda *_: run)
    case = SimpleNamespace(validate=[SimpleNamespace(name="held out")])
    with pytest.raises(
        ModelError,
        match=r"the simulation of held out, which drifts in open loop, at t = .* has no volume",
    ):
        trajectory_file.simulate_case(axis, case, closed_loop=False)


def test_the_first_time_of_a_simulation_is_written_without_a_sign():
    t = np.array([-1e-12, 1e-3])
    run = SimpleNamespace(inputs=(), outputs=())
    simulated = trajectory_file.RecordSimulation(Times({"t": t}), run)
    first = trajectory_file.trajectory_frame(simulated)["t_s"].iloc[0]
    assert not np.signbit(first)


def test_a_jump_over_the_sample_without_volume_is_seen(axis):
    x = np.tile(np.array(X_0)[:, None], 4)
    x[2, 2:] = 24.0
    with pytest.raises(ModelError, match=r"at t = 0.002 s \(sample 2\): x = 24 m"):
        require_physical(axis.kind, axis.parameters, DT * np.arange(4), x, np.zeros((2, 4)))


def test_the_first_pressure_that_no_gas_has_is_named(axis):
    x = np.tile(np.array(X_0)[:, None], 4)
    x[0, 3], x[1, 1] = -1.0, -147e3
    with pytest.raises(ModelError, match=r"\(sample 1\): p_N = -147000 Pa, which no gas has"):
        require_physical(axis.kind, axis.parameters, DT * np.arange(4), x, np.zeros((2, 4)))


def test_a_measured_supply_without_pressure_is_refused(made):
    supplied = made.supplied_axis()
    u = np.tile([0.0, 0.0, 6e5], (N, 1))
    u[7, 2] = 0.0
    with pytest.raises(ModelError, match=r"\(sample 7\): p_supply = 0 Pa.*absolute pressures"):
        simulate(supplied, u, DT, X_0)


@pytest.mark.parametrize(
    ("u", "message"),
    [
        (np.zeros((100, 3)), r"u: shape \(100, 3\), expected \(N, 2\), .*of u_P, u_N$"),
        (np.zeros((2, 100)), r"u: shape \(2, 100\), .*; give its transpose"),
        (np.zeros(100), r"u: shape \(100,\), expected \(N, 2\)"),
        (np.zeros((0, 2)), r"u: 0 samples; give at least 2"),
        ([], r"u: shape \(0,\), expected"),
        ("volts", r"u: could not convert .*; give an array of numbers"),
        ([[0.0, 0.0], [np.nan, 0.0]], r"u: nan at sample 1; give finite numbers"),
    ],
)
def test_inputs_of_another_shape_are_refused_with_the_one_expected(axis, u, message):
    with pytest.raises(ModelError, match=message):
        simulate(axis, u, DT, X_0)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"x_ref": []}, r"x_ref: 0 samples"),
        ({"x_ref": np.zeros((N, 1))}, r"x_ref: shape \(20, 1\), expected \(N,\)"),
        ({"disturbance": np.zeros(7)}, r"disturbance: shape \(7,\), expected \(20,\) or"),
        ({"memory": np.zeros(9)}, r"memory: shape \(9,\), expected \("),
        ({"lengths": np.ones(N)}, r"lengths: shape \(20,\), expected \(19,\)"),
        ({"lengths": np.r_[np.ones(N - 2), -1]}, r"lengths: -1 at sample 18; give lengths above"),
    ],
)
def test_references_and_what_goes_with_them_are_refused_in_another_shape(axis, given, message):
    with pytest.raises(ModelError, match=message):
        simulate_closed_loop(axis, **{"x_ref": np.zeros(N), "dt": DT, "x_0": X_0, **given})
