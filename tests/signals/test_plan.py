import warnings

import numpy as np
import pytest

from pneumo_casadi.errors import ModelError
from pneumo_casadi.signals import (
    FilterPlan,
    SamplingWarning,
    plan_filters,
    power_bandwidth,
    white_noise_std,
)


@pytest.mark.parametrize("f_dyn", [0.5, 1.5, 6.0, 20.0, 48.0])
def test_planned_cutoffs_keep_the_bound_in_the_whole_useful_band(f_dyn):
    plan = plan_filters(5e3, f_dyn, bound=0.01)
    assert plan.passband >= 1.9 * f_dyn
    for frequency in np.linspace(0.01, plan.f_bound, 50):
        assert abs(plan.distortion(frequency).acceleration) <= 0.01 * (1 + 1e-9)


def test_sampling_slower_than_eq_14_warns():
    with pytest.warns(SamplingWarning, match="50 times the bandwidth of 20 Hz"):
        plan_filters(1e3, 20.0, bound=0.05)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plan_filters(5e3, 50.0, bound=0.0105)


def test_eq_14_is_where_two_central_differences_use_up_half_of_a_one_percent_bound():
    at_the_limit = plan_filters(1e4, 1e4 / 103.0)
    assert at_the_limit.distortion(2e4 / 103.0).acceleration == pytest.approx(-0.005, abs=5e-4)


def test_a_bandwidth_too_high_for_the_bound_is_refused_with_the_remedy():
    with pytest.warns(SamplingWarning), pytest.raises(ModelError, match="allow a bound above"):
        plan_filters(1e3, 40.0, bound=0.01)


def test_the_plan_prints_cutoffs_and_their_effect():
    text = FilterPlan(1e3, cutoff=100.0, factor=10, f_dyn=20.0).describe()
    for part in ("cut-off 100 Hz", "1 row in 10", "eq. 14 (at least 100) violated", "-2.139 %"):
        assert part in text


def test_the_bandwidth_of_a_chirp_is_found_beneath_sensor_noise():
    fs = 5e3
    t = np.arange(100_000) / fs
    chirp = 0.05 * np.sin(2 * np.pi * 0.05 * t**2)  # 0 to 2 Hz in 20 s
    noisy = chirp + np.random.default_rng(0).normal(0, 1.5e-5, t.size)
    assert power_bandwidth(chirp, fs) == pytest.approx(1.9, abs=0.3)
    assert power_bandwidth(noisy, fs) == pytest.approx(power_bandwidth(chirp, fs), abs=0.25)
    assert white_noise_std(noisy) == pytest.approx(1.5e-5, rel=0.02)


def test_an_axis_at_rest_has_no_bandwidth():
    rest = np.random.default_rng(0).normal(0, 1e-5, 20_000)
    with pytest.raises(ModelError, match="give the bandwidth f_dyn yourself"):
        power_bandwidth(rest, 1e3)


@pytest.mark.parametrize("f_dyn", [0.0, -1.0, 600.0])
def test_a_bandwidth_outside_the_band_is_refused(f_dyn):
    with pytest.raises(ModelError, match="must lie between 0 and half"):
        plan_filters(1e3, f_dyn)
