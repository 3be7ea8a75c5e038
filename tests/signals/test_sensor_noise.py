"""The level of sensor noise in the band of the motion."""

import numpy as np
import pytest
from scipy.signal import lfilter

from pneumo_casadi.signals.bandwidth import white_noise_std
from pneumo_casadi.signals.sensor_noise import (
    SensorNoise,
    estimate_sensor_noise,
)

FS = 1000.0


def sensor_noise_std(values, fs):
    return estimate_sensor_noise(values, fs).in_band


def noise(rho, N=20_000, seed=0):
    """Noise of first order whose innovations have unit variance."""
    white = np.random.default_rng(seed).normal(size=N)
    return lfilter([1.0], [1.0, -rho], white)


def level(rho, f=15.0):
    """Its power spectral density over that of unit white noise, as a standard deviation."""
    return 1 / abs(1 - rho * np.exp(-2j * np.pi * f / FS))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("N", [2000, 20_000])
def test_white_noise_is_what_the_differences_say(N, seed):
    """To the bit: nothing changes where noise is white."""
    values = 3.0 * noise(0.0, N, seed) + np.linspace(0, 100, N)
    assert sensor_noise_std(values, FS) == white_noise_std(values)


@pytest.mark.parametrize("rho", [0.6, 0.8, 0.9, 0.95])
def test_coloured_noise_is_as_large_as_in_the_band_of_the_motion(rho):
    values = noise(rho)
    assert white_noise_std(values) < 0.7 * level(rho)
    assert sensor_noise_std(values, FS) == pytest.approx(level(rho), rel=0.35)


@pytest.mark.parametrize("rho", [0.5, 0.8, 0.9])
@pytest.mark.parametrize("f", [15.0, 45.0, 150.0])
def test_noise_of_first_order_is_known_at_every_frequency(rho, f):
    estimate = estimate_sensor_noise(noise(rho), FS)
    assert estimate.at(f) == pytest.approx(level(rho, f), rel=0.15)


@pytest.mark.parametrize("rho", [0.0, 0.8])
def test_noise_that_is_drawn_is_as_large_and_correlated_as_said(rho):
    values = SensorNoise(2.0, rho, FS).draw(200_000, np.random.default_rng(1))
    assert np.std(values) == pytest.approx(2.0 / np.sqrt(1 - rho**2), rel=0.02)
    assert np.corrcoef(values[1:], values[:-1])[0, 1] == pytest.approx(rho, abs=0.01)
    starts = [SensorNoise(2.0, rho, FS).draw(1, np.random.default_rng(k))[0] for k in range(2000)]
    assert np.std(starts) == pytest.approx(np.std(values), rel=0.06)


def test_motion_steps_and_the_mains_are_no_noise():
    """A stroke at 2 Hz, twenty steps, and 50 Hz ten times as large as the noise."""
    t = np.arange(20_000) / FS
    motion = 1e3 * np.sin(2 * np.pi * 2.0 * t) + 500.0 * np.floor(t)
    hum = 10.0 * np.sin(2 * np.pi * 50.0 * t)
    for values in (noise(0.0) + motion, noise(0.0) + hum):
        assert sensor_noise_std(values, FS) == pytest.approx(1.0, rel=0.05)
    assert sensor_noise_std(noise(0.8) + motion, FS) == pytest.approx(level(0.8), rel=0.35)


@pytest.mark.parametrize("rho", [0.6, 0.8, 0.9])
@pytest.mark.parametrize("amplitude", [3.0, 10.0])
def test_the_mains_are_no_noise_beside_coloured_noise(rho, amplitude):
    hum = np.arange(20_000)[:, None] / FS * 2 * np.pi * np.array([50.0, 150.0])
    values = noise(rho) + amplitude * np.sin(hum).sum(axis=1)
    assert sensor_noise_std(values, FS) == pytest.approx(level(rho), rel=0.5)


@pytest.mark.parametrize("fs", [1.0, 2.0, 2.4, 20.0])
def test_a_slow_clock_tells_no_colour(fs):
    values = noise(0.8)
    assert sensor_noise_std(values, fs) == white_noise_std(values)


@pytest.mark.parametrize(("N", "fs"), [(500, FS), (20_000, 150.0), (20_000, 300.0)])
def test_a_record_too_short_or_slow_to_tell_counts_as_white_or_by_one_band(N, fs):
    values = noise(0.8, N)
    found = sensor_noise_std(values, fs)
    assert np.isfinite(found) and found >= white_noise_std(values)


def test_a_constant_signal_has_no_noise():
    assert sensor_noise_std(np.ones(3000), FS) == 0.0
