import numpy as np
import pytest

from pneumo_casadi.errors import ModelError
from pneumo_casadi.signals import (
    amplitude_distortion,
    central_difference,
    least_cutoff,
    noise_gains,
    settling_samples,
    smooth_difference,
    zero_phase_lowpass,
)


@pytest.mark.parametrize(("order", "cutoff"), [(2, 60.0), (4, 100.0), (6, 250.0)])
@pytest.mark.parametrize("frequency", [5.0, 40.0, 90.0])
def test_a_sine_loses_the_predicted_share_of_its_amplitude_and_no_phase(order, cutoff, frequency):
    fs = 1e3
    t = np.arange(4000) / fs
    w = 2 * np.pi * frequency
    predicted = amplitude_distortion(frequency, cutoff, fs, order)
    x = zero_phase_lowpass(np.sin(w * t), cutoff, fs, order)
    v = central_difference(x, 1 / fs)
    a = central_difference(v, 1 / fs)
    middle = slice(1000, 3000)
    for measured, ideal, share in (
        (x, np.sin(w * t), predicted.position),
        (v, w * np.cos(w * t), predicted.velocity),
        (a, -(w**2) * np.sin(w * t), predicted.acceleration),
    ):
        gap = np.abs(measured - (1 + share) * ideal)[middle].max() / np.abs(ideal).max()
        assert gap < 1e-9


@pytest.mark.parametrize("bound", [0.002, 0.01, 0.05])
def test_the_least_cutoff_uses_up_the_bound_and_a_lower_one_breaks_it(bound):
    f_c = least_cutoff(15.0, bound, 5e3, order=3)
    assert amplitude_distortion(15.0, f_c, 5e3, 3).acceleration == pytest.approx(-bound, rel=1e-9)
    assert amplitude_distortion(15.0, 0.99 * f_c, 5e3, 3).acceleration < -bound
    assert amplitude_distortion(7.0, f_c, 5e3, 3).acceleration > -bound


def test_a_bound_that_the_differences_alone_break_is_refused_with_the_one_they_keep():
    with pytest.raises(ModelError, match=r"already lose 2\.1 % .* allow a bound above 2\.1 %"):
        least_cutoff(40.0, 0.01, 1e3)


@pytest.mark.parametrize("cutoff", [20.0, 100.0])
def test_after_the_settling_time_the_edge_is_forgotten(cutoff):
    fs = 1e3
    long = np.random.default_rng(4).normal(size=3000)
    cut = 1000
    settled = settling_samples(cutoff, fs)
    alone = zero_phase_lowpass(long[cut:], cutoff, fs)
    gap = np.abs(alone - zero_phase_lowpass(long, cutoff, fs)[cut:])
    assert gap[settled:-settled].max() < 1e-3
    assert gap[: settled // 4].max() > 0.05


def test_noise_gains_are_what_noise_becomes():
    noise = np.random.default_rng(2).normal(size=400_000)
    x = zero_phase_lowpass(noise, 50.0, 1e3)
    v = central_difference(x, 1e-3)
    a = central_difference(v, 1e-3)
    measured = [np.std(part) for part in (x, v, a)]
    np.testing.assert_allclose(measured, noise_gains(50.0, 1e3), rtol=0.02)


def test_differences_of_a_parabola_are_exact_inside_and_of_first_order_at_the_ends():
    t = np.arange(6.0)
    np.testing.assert_allclose(central_difference(t**2, 1.0), [1, 2, 4, 6, 8, 9])


def test_a_signal_shorter_than_its_continuation_is_refused():
    with pytest.raises(ModelError, match="12 samples are too few"):
        zero_phase_lowpass(np.zeros(12), 10.0, 1e3, order=4)


@pytest.mark.parametrize("cutoff", [0.0, 500.0, -1.0])
def test_a_cutoff_outside_the_band_is_refused(cutoff):
    with pytest.raises(ModelError, match="must lie between 0 and half"):
        zero_phase_lowpass(np.zeros(100), cutoff, 1e3)


def test_the_input_is_not_changed():
    values = np.random.default_rng(0).normal(size=200)
    kept = values.copy()
    zero_phase_lowpass(values, 10.0, 1e3)
    np.testing.assert_array_equal(values, kept)


@pytest.mark.parametrize(("frequency", "least"), [(10.0, 1e-9), (60.0, 1e-4)])
def test_a_smooth_signal_is_differentiated_without_loss(frequency, least):
    t, w = np.arange(2000) * 1e-3, 2 * np.pi * frequency
    ideal = w * np.cos(w * t)
    worst = {
        difference: np.abs(difference(np.sin(w * t), 1e-3) - ideal)[10:-10].max() / w
        for difference in (central_difference, smooth_difference)
    }
    assert worst[smooth_difference] < least
    assert worst[central_difference] > 100 * worst[smooth_difference]


@pytest.mark.parametrize("N", [2, 8, 9, 30])
def test_ends_and_short_signals_are_differentiated_too(N):
    x = np.random.default_rng(N).normal(size=N)
    slope, plain = smooth_difference(x, 0.5), central_difference(x, 0.5)
    ends = np.r_[0 : min(4, N), max(N - 4, 0) : N]
    np.testing.assert_array_equal(slope[ends], plain[ends])
    line = smooth_difference(3.0 * np.arange(N), 0.5)
    np.testing.assert_allclose(line, 6.0, rtol=1e-12)


@pytest.mark.parametrize("difference", [central_difference, smooth_difference])
@pytest.mark.parametrize("fs", [200.0, 1000.0])
def test_noise_is_amplified_as_told_by_either_difference(difference, fs):
    white = np.random.default_rng(0).normal(size=200_000)
    x = zero_phase_lowpass(white, 60.0, fs)
    v = difference(x, 1 / fs)
    a = difference(v, 1 / fs)
    gains = noise_gains(60.0, fs, difference=difference)
    assert [np.std(part[50:-50]) for part in (x, v, a)] == pytest.approx(gains, rel=0.02)
