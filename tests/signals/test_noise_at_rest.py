"""Sensor noise where the axis rests."""

import numpy as np
import pytest
import scipy

from pneumo_casadi.data import InputHold, Recording
from pneumo_casadi.signals.noise_at_rest import sensor_noises
from pneumo_casadi.signals.sensor_noise import SensorNoise, estimate_sensor_noise

#: White noise beside that of a filter at 13 Hz: of these two samples of one sensor.
MIXED = SensorNoise(0.165, 0.92, 1000.0, 0.85)
WHITE = SensorNoise(0.9, 0.0, 1000.0)


def record(noise, share, seed=0, fs=1000.0, N=16_000):
    """Strokes of half a second, between which the axis rests for a share of the time."""
    rng = np.random.default_rng(seed)
    t = np.arange(N) / fs
    moving = (t % 2.0) / 2.0 >= share
    stroke = 0.05 * np.where(moving, np.sin(2 * np.pi * t) ** 2, 0.0)
    pressure = 3e5 + 1e5 * np.where(moving, np.sin(9.0 * t) * np.sin(2 * np.pi * t), 0.0)
    # At rest a pressure settles, slowly and by more than its noise.
    pressure += 2e3 * np.exp(-(t % 2.0) / 0.3)
    channels = {"x": stroke + 1e-5 * noise.draw(N, rng), "p_P": pressure + 100 * noise.draw(N, rng)}
    return Recording(t, channels, "strokes", "simulated", InputHold.ZERO)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("channel", "unit"), [("x", 1e-5), ("p_P", 100.0)])
def test_white_noise_beside_that_of_a_slow_filter_is_seen_at_rest(channel, unit, seed):
    run = record(MIXED, 0.5, seed)
    (at_rest,) = sensor_noises([run], channel)
    assert at_rest.in_band == pytest.approx(unit * MIXED.in_band, rel=0.3)
    assert at_rest.at(200.0) == pytest.approx(unit * MIXED.at(200.0), rel=0.15)
    assert estimate_sensor_noise(run[channel], 1000.0).in_band < 0.65 * at_rest.in_band


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("channel", ["x", "p_P"])
def test_white_noise_is_what_the_whole_record_says(channel, seed):
    """To the bit: nothing changes where noise is white."""
    run = record(WHITE, 0.5, seed)
    assert sensor_noises([run], channel) == (estimate_sensor_noise(run[channel], 1000.0),)


@pytest.mark.parametrize("frequency", [20.0, 30.0, 50.0])
@pytest.mark.parametrize("amplitude", [50.0, 300.0])
def test_a_tone_is_no_noise(frequency, amplitude):
    run = record(WHITE, 0.5)
    tone = amplitude * np.sin(2 * np.pi * frequency * run.t)
    (noise,) = sensor_noises([run.with_channels({"p_P": run["p_P"] + tone})], "p_P")
    assert noise.in_band == pytest.approx(90.0, rel=0.35)


@pytest.mark.parametrize(("fs", "corner"), [(10_000.0, 1000.0), (10_000.0, 200.0), (2000.0, 300.0)])
def test_noise_behind_a_filter_of_second_order_is_as_large_as_before_it(fs, corner):
    """What a sensor's filter takes away above 300 Hz says nothing of the band of the motion."""
    run = record(SensorNoise(1e-6, 0.0, fs), 0.5, fs=fs, N=int(16 * fs))
    white = np.random.default_rng(3).normal(0.0, 100.0, run.N)
    filtered = scipy.signal.lfilter(*scipy.signal.butter(2, corner, fs=fs), white)
    (noise,) = sensor_noises([run.with_channels({"p_P": run["p_P"] + filtered})], "p_P")
    assert noise.in_band == pytest.approx(100.0, rel=0.35)


@pytest.mark.parametrize("fs", [500.0, 5000.0, 20_000.0, 50_000.0])
def test_the_clock_does_not_matter(fs):
    """Noise of the same spectrum, ten times as large at 15 Hz as that of the converter."""
    correlation = np.exp(-2 * np.pi * 13.0 / fs)
    innovation = 3.0 * abs(np.exp(2j * np.pi * 15.0 / fs) - correlation)
    noise = SensorNoise(innovation, correlation, fs, 1.0)
    (found,) = sensor_noises([record(noise, 0.5, fs=fs, N=int(16 * fs))], "p_P")
    assert found.in_band == pytest.approx(100 * noise.in_band, rel=0.35)


def test_without_rests_the_levels_above_the_motion_tell():
    run = record(MIXED, 0.0)
    assert sensor_noises([run], "p_P") == (estimate_sensor_noise(run["p_P"], 1000.0),)


def test_a_record_without_rests_has_the_noise_that_another_one_shows():
    resting, moving = record(MIXED, 0.5), record(MIXED, 0.0, seed=1)
    assert len(set(sensor_noises([moving, resting], "p_P"))) == 1
    other_clock = record(SensorNoise(0.165, 0.92, 2000.0, 0.85), 0.0, fs=2000.0)
    first, second = sensor_noises([other_clock, resting], "p_P")
    assert second == sensor_noises([resting], "p_P")[0] and second != first


def test_short_records_and_those_without_a_position_are_told_by_themselves():
    run, short = record(MIXED, 0.5), record(MIXED, 0.5, N=150)
    assert sensor_noises([run, short], "p_P") == sensor_noises([run, run], "p_P")
    (alone,) = sensor_noises([short], "p_P")
    assert alone == estimate_sensor_noise(short["p_P"], 1000.0)
    without = Recording(run.t, {"p_P": run["p_P"]}, "pressure", "simulated", InputHold.ZERO)
    assert sensor_noises([without], "p_P") == (estimate_sensor_noise(run["p_P"], 1000.0),)


def test_noise_below_the_quantum_is_not_seen_at_rest():
    run = record(SensorNoise(1e-3, 0.0, 1000.0), 0.5)
    coarse = run.with_channels({"p_P": 1e4 * np.round(run["p_P"] / 1e4)})
    assert sensor_noises([coarse], "p_P") == (estimate_sensor_noise(coarse["p_P"], 1000.0),)


def test_noise_of_two_parts_is_drawn_as_large_as_said():
    values = MIXED.draw(200_000, np.random.default_rng(1))
    variance = 0.85**2 + 0.165**2 / (1 - 0.92**2)
    assert np.var(values) == pytest.approx(variance, rel=0.03)
