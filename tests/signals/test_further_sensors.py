"""Velocity and acceleration sensors in the filtered states, and records with their own stamps."""

import numpy as np
import pytest

from pneumo_casadi.data import Clock, InputHold, Recording
from pneumo_casadi.signals import FilterPlan, filter_recording, plan_filters_for
from pneumo_casadi.signals.resampling import on_uniform_clock

FS, N, W = 1e3, 8000, 2 * np.pi * 1.5
PLAN = FilterPlan(sampling_frequency=FS, cutoff=60.0)


def sine(noise, seed=0, **sensors):
    rng = np.random.default_rng(seed)
    t = np.arange(N) / FS
    truth = {
        "x": 0.1 * np.sin(W * t),
        "v": 0.1 * W * np.cos(W * t),
        "a": -0.1 * W**2 * np.sin(W * t),
    }
    stds = {"x": noise, **sensors}
    channels = {name: truth[name] + std * rng.normal(size=N) for name, std in stds.items()}
    return Recording(t, channels, "sine", "made", InputHold.LINEAR), truth


def errors(record, truth):
    filtered = filter_recording(record, PLAN)
    kept = slice(filtered.dropped[0], N - filtered.dropped[1])
    v = np.std(filtered.states["v"] - truth["v"][kept])
    return v, np.std(filtered.derivatives["v"] - truth["a"][kept]), filtered.velocity_noise


def test_a_good_velocity_sensor_improves_velocity_and_acceleration():
    v, a, expected = errors(*sine(5e-5))
    v_with, a_with, expected_with = errors(*sine(5e-5, v=1e-3))
    assert v_with < 0.3 * v and a_with < 0.3 * a
    assert expected_with == pytest.approx(v_with, rel=0.3)
    assert expected == pytest.approx(v, rel=0.3)


def test_a_poor_velocity_sensor_does_no_harm():
    v, a, _ = errors(*sine(1e-6))
    v_with, a_with, _ = errors(*sine(1e-6, v=0.5, a=50.0))
    assert v_with < 1.05 * v and a_with < 1.05 * a


def test_an_acceleration_sensor_is_used_where_it_is_better():
    _, a, _ = errors(*sine(5e-5))
    _, a_with, _ = errors(*sine(5e-5, a=0.05))
    assert a_with < 0.1 * a


def test_a_record_at_rest_does_not_set_the_bandwidth():
    moving, _ = sine(1e-5)
    still = Recording(
        moving.t, {"x": 1e-5 * np.random.default_rng(1).normal(size=N)}, "rest", "made",
        InputHold.LINEAR,
    )  # fmt: skip
    assert plan_filters_for([moving, still]) == plan_filters_for([moving])


def test_resampling_keeps_the_integral_of_a_held_input_and_the_course_of_a_signal():
    rng = np.random.default_rng(2)
    t = np.arange(N) / FS
    t[1:-1] += 2e-4 * rng.uniform(-1, 1, N - 2)
    u = np.repeat(rng.normal(size=N // 40), 40)
    record = Recording(
        t, {"x": np.sin(W * t), "u_P": u}, "jitter", "made", InputHold.ZERO, clock=Clock.AS_RECORDED
    )
    uniform = on_uniform_clock(record)
    assert uniform.clock is Clock.UNIFORM
    assert uniform["x"] == pytest.approx(np.sin(W * uniform.t), abs=1e-8)
    held = np.sum(u[:-1] * np.diff(t))
    last = uniform.t[-1] - t[-1]  # the uniform clock ends within a step of the last stamp
    assert np.sum(uniform["u_P"][:-1]) * uniform.dt == pytest.approx(held + last * u[-1], abs=2e-3)
    assert on_uniform_clock(uniform) is uniform
