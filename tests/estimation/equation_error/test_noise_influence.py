"""What sensor noise does to an equation-error fit is told by adding it once more."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from pneumo_casadi.data import InputHold, Recording
from pneumo_casadi.effects import PressureSensorLag
from pneumo_casadi.errors import FitError
from pneumo_casadi.estimation.equation_error import (
    estimate_noise_influence,
    fit_equation_error,
    noise_influence,
)
from pneumo_casadi.estimation.equation_error.smoothed_motion import (
    coloured_velocity_noise,
    smooth_motion,
)
from pneumo_casadi.model.simulation import simulate
from pneumo_casadi.signals.noise_at_rest import sensor_noises
from pneumo_casadi.signals.sensor_noise import SensorNoise

DT, PAIRS = 1e-3, 3
TAU = "pressure_sensor_lag.tau"


@pytest.fixture(scope="module")
def estimates(made):
    """Error, bias and standard deviation of a sensor's lag, noise of the pressure correlated.

    Each noise is taken with either sign: in the mean of their errors only the bias remains.
    """
    true = made.true_axis(PressureSensorLag()).with_parameters({TAU: 4e-3, "v_s": 1e-3})
    flow = true.flow_parameters
    start = true.with_parameters(true.parameters.fix(*flow))
    clean = made.recorded(true, *made.controlled(true, 6000), noise=0.0)
    rng = np.random.default_rng(0)
    rows = []
    noises = [
        {n: SensorNoise(1000.0, 0.8, 1 / DT).draw(clean.N, rng) for n in ("p_P", "p_N")}
        for _ in range(PAIRS)
    ]
    for sign, noise in product((1, -1), noises):
        noisy = {name: clean[name] + sign * noise[name] for name in noise}
        record = replace(clean, channels=dict(clean.channels) | noisy)
        axis = fit_equation_error(start, [record]).axis
        influence = estimate_noise_influence(axis, [record], None)
        at = influence.names.index(TAU)
        error = axis.parameters[TAU].value - true.parameters[TAU].value
        rows.append((error, influence.bias[at], influence.std[at]))
    return np.array(rows).T


@pytest.fixture(scope="module")
def clean(made):
    """A force-driven axis and its motion under a sine, without noise."""
    true = made.true_force_axis()
    t = DT * np.arange(2000)
    F = 60.0 * np.sin(2 * np.pi * 1.1 * t)
    x = simulate(true, F[:, None], DT, [0.0, 0.0])["x"]
    return true, Recording(t, {"F": F, "x": x}, "clean", "simulated", InputHold.ZERO)


@pytest.mark.slow
def test_the_bias_is_told(estimates):
    error, bias, std = estimates
    assert error.mean() < -std.mean()  # noise in the derivative makes the lag too short
    assert bias.mean() == pytest.approx(error.mean(), rel=0.3)


@pytest.mark.slow
def test_without_its_bias_the_estimate_lies_within_its_standard_deviation(estimates):
    error, bias, std = estimates
    assert np.sqrt(np.mean((error / std) ** 2)) > 1.5
    assert 0.3 < np.sqrt(np.mean(((error - bias) / std) ** 2)) < 1.4


def test_a_parameter_at_its_bound_has_no_influence(clean):
    true, record = clean
    at_bound = true.with_parameters({"M": true.parameters["M"].lower})
    influence = estimate_noise_influence(at_bound, [record], None)
    assert "M" not in influence.names and "f_v" in influence.names
    assert influence.covariance.shape == (len(influence.names),) * 2


def test_under_white_noise_the_rows_are_those_of_the_fit(made):
    true = made.true_axis()
    record = made.recorded(true, *made.controlled(true, 1000))
    noise = coloured_velocity_noise(record, *sensor_noises([record], "x"))
    assert noise == smooth_motion(true, record).velocity_noise > 0


def test_a_parameter_of_which_the_records_say_nothing_spoils_no_other(clean, monkeypatch):
    true, record = clean
    linearise = noise_influence.Problem.linearise

    def without_f_v(problem, point):
        linear = linearise(problem, point)
        return replace(linear, A=linear.A * (np.array(problem.model.free) != "f_v"))

    monkeypatch.setattr(noise_influence.Problem, "linearise", without_f_v)
    influence = estimate_noise_influence(true, [record], None)
    assert "f_v" not in influence.names and "M" in influence.names
    assert np.isfinite(influence.std).all()


def test_noise_that_hides_all_motion_is_said(made):
    true = made.true_force_axis()
    t = DT * np.arange(2000)
    F = 20.0 * np.sin(2 * np.pi * 1.1 * t)
    x = simulate(true, F[:, None], DT, [0.0, 0.0])["x"]
    x = x + np.random.default_rng(0).normal(0.0, 1e-2, t.size)
    record = Recording(t, {"F": F, "x": x}, "noise", "simulated", InputHold.ZERO)
    with pytest.raises(FitError, match="too few rows"):
        estimate_noise_influence(true, [record], None)


def test_what_is_no_number_is_no_result(clean, monkeypatch):
    true, record = clean
    linearise = noise_influence.Problem.linearise

    def without_numbers(problem, point):
        linear = linearise(problem, point)
        return replace(linear, A=np.full_like(linear.A, np.nan))

    monkeypatch.setattr(noise_influence.Problem, "linearise", without_numbers)
    with pytest.raises(FitError, match="no numbers"):
        estimate_noise_influence(true, [record], None)
