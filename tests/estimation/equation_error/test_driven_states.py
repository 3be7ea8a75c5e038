"""States of effects along a record, as the measured motion drives them."""

from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import ForceBench, InputHold, NestedController, Recording
from pneumo_casadi.effects import EFFECTS, PressureSensorLag, PressureSensorSecondOrder
from pneumo_casadi.effects.term import Term, term_effect
from pneumo_casadi.estimation.equation_error import fit_equation_error
from pneumo_casadi.estimation.equation_error.driven_states import states_along
from pneumo_casadi.estimation.equation_error.true_motion import _lateness
from pneumo_casadi.model.servosystem import ForceAxis
from pneumo_casadi.model.simulation import simulate

GAP = 2e-3


@pytest.fixture(scope="module")
def axis():
    """A mass whose position sensor has a play."""
    bench = ForceBench(1e3, 0.5, NestedController(30.0, 60.0, 1.0, 60.0))
    known = {"M": 18.0, "f_v": 25.0, "F_c_plus": 12.0, "F_c_minus": 17.0, "backlash.gap": GAP}
    return ForceAxis(bench).with_effects(EFFECTS["backlash"]()).with_parameters(known)


@pytest.fixture(scope="module")
def run(axis):
    t = np.arange(4000) / 1e3
    force = 60.0 * np.sin(2 * np.pi * t)
    start = np.zeros(len(axis.states))
    return t, force, simulate(axis, force[:, None], 1e-3, start)


@pytest.fixture(scope="module")
def record(run):
    t, force, trajectory = run
    return Recording(t, {"F": force, "x": trajectory["x"]}, "sine", "simulated", InputHold.ZERO)


def test_the_play_lies_where_the_motion_has_left_it(axis, run, record):
    (states,) = states_along(axis, [record])
    offset = run[2]["backlash.offset"][: record.N]
    settled = record.t > 1.0  # both have been across the play
    away = np.abs(states[0] - offset)[settled]
    assert np.ptp(offset) > 0.9 * GAP
    assert np.quantile(away, 0.9) < 0.1 * GAP


def test_time_is_that_of_the_record(axis, record):
    """From the first sample on, of which the filters take some; otherwise a phase would turn."""
    hum = {"amplitude": 5.0, "phase": 0.0, "period": 0.1}
    shaken = ForceAxis(axis.bench).with_effects(
        term_effect(Term("hum", ("force",), "1", "t", "sine", hum))()
    )
    part = record.window(1.0, 3.0)
    ((t,),) = states_along(shaken, [part])
    inside = slice(200, -200)
    assert t[inside] == pytest.approx(part.t[inside], abs=1e-6)


def test_an_axis_without_states_of_effects_has_none(axis, record):
    assert states_along(ForceAxis(axis.bench), [record]) == ()


@pytest.mark.slow
def test_a_lag_of_four_samples_keeps_its_length(made):
    """With one step of ROS2 a sample, 4 ms at 1 kHz come out 0.25 % too long."""
    tau = "pressure_sensor_lag.tau"
    true = made.true_axis(PressureSensorLag()).with_parameters({tau: 4e-3, "v_s": 1e-3})
    start = true.with_parameters(true.parameters.fix(*true.flow_parameters))
    record = made.recorded(true, *made.controlled(true, 1500), noise=0.0)
    fit = fit_equation_error(start.with_parameters({tau: 3e-3}), [record])
    assert fit.parameters[tau].value == pytest.approx(4e-3, rel=1.5e-3)


@pytest.mark.slow
def test_a_sensor_that_swings_keeps_delay_and_damping(made):
    """12 ms at ζ = 0.5 is 13 Hz: corrections must be put ahead, or they do not settle."""
    names = {"pressure_sensor_second_order.tau": 12e-3, "pressure_sensor_second_order.zeta": 0.5}
    true = made.true_axis(PressureSensorSecondOrder()).with_parameters({**names, "v_s": 1e-3})
    start = true.with_parameters(true.parameters.fix(*true.flow_parameters))
    record = made.recorded(true, *made.controlled(true, 1500), noise=0.0)
    begin = {"pressure_sensor_second_order.tau": 3e-3, "pressure_sensor_second_order.zeta": 0.7}
    fit = fit_equation_error(start.with_parameters(begin), [record])
    for name, value in names.items():
        assert fit.parameters[name].value == pytest.approx(value, rel=0.02), name


def test_a_sensor_is_late_in_the_mean_by_what_it_lacks_over_rate_and_acceleration():
    t = np.arange(500) / 20
    shown, rate = np.sin(t) + np.sin(3 * t) / 3, np.cos(t) + np.cos(3 * t)
    acceleration = -np.sin(t) - 3 * np.sin(3 * t)
    ahead = 4e-3 * rate + 2e-5 * acceleration
    given = shown, rate, acceleration
    np.testing.assert_allclose(_lateness(ahead, *given), [4e-3, 2e-5], rtol=1e-9)
    np.testing.assert_allclose(_lateness(ahead + 0.2 * shown + 3, *given), [4e-3, 2e-5], rtol=1e-6)
    np.testing.assert_allclose(_lateness(0.2 * shown + 3, *given), [0, 0], atol=1e-12)
    np.testing.assert_array_equal(_lateness(-ahead, *given), [0, 0])  # no sensor is early
    np.testing.assert_array_equal(_lateness(ahead, shown, 0 * rate, 0 * rate), [0, 0])


def test_late_pressures_are_taken_back_beside_an_accelerometer(made):
    """An acceleration is no state of the motion, and no sensor effect acts on it."""
    tau = "pressure_sensor_lag.tau"
    plain = made.true_axis(PressureSensorLag()).with_parameters({tau: 4e-3})
    record = made.recorded(plain, *made.controlled(plain, 1500), noise=0.0)
    v = np.gradient(record["x"], record.dt)
    record = record.with_channels({"a": np.gradient(v, record.dt)})
    bench = replace(made.BENCH, signals=frozenset({"a"}), noise=None)
    axis = replace(plain, bench=bench)
    (states,) = states_along(axis, [record])
    (expected,) = states_along(replace(axis, bench=made.BENCH), [record])
    assert states == pytest.approx(expected, rel=1e-6)
