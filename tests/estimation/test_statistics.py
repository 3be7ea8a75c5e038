"""Covariance where there is information, infinity where there is none."""

import numpy as np
import pytest
from scipy import signal, stats

from pneumo_casadi.data import InputHold, Recording, SensorNoise
from pneumo_casadi.estimation.robust_covariance import batch_sandwich, batches
from pneumo_casadi.estimation.statistics import (
    autocorrelation,
    interval_factor,
    invert_information,
    stated_or_estimated_noise,
)

NAMES = ("a", "b", "c", "d")


def information(seed=0, n=4, rows=30):
    J = np.random.default_rng(seed).standard_normal((rows, n))
    return J, J.T @ J


def test_regular_information_is_inverted_in_si_units():
    _, H = information()
    scales = np.array([1e-9, 17.0, 1e5, 1.0])
    result = invert_information(H, scales, NAMES)
    np.testing.assert_allclose(result.covariance, np.linalg.inv(H) * np.outer(scales, scales))
    np.testing.assert_allclose(result.std, np.sqrt(np.diag(result.covariance)))
    assert result.uninformed == result.at_bound == result.combinations == ()


@pytest.mark.parametrize("factor", [1e-9, 1.0, 1e9])
def test_the_choice_of_scales_changes_no_covariance(factor):
    J, H = information()
    size = np.array([1.0, factor, 1.0, 1 / factor])
    plain = invert_information(H, np.ones(4), NAMES)
    other = invert_information((J * size).T @ (J * size), size, NAMES)
    np.testing.assert_allclose(other.covariance, plain.covariance, rtol=1e-6)


def test_a_parameter_without_influence_is_infinite_and_the_others_are_as_without_it():
    J, _ = information()
    J[:, 2] = 0.0
    result = invert_information(J.T @ J, np.ones(4), NAMES)
    assert result.uninformed == ("c",) and result.std[2] == np.inf
    rest = [0, 1, 3]
    np.testing.assert_allclose(
        result.covariance[np.ix_(rest, rest)], np.linalg.inv(J[:, rest].T @ J[:, rest])
    )
    assert not result.covariance[2, rest].any()
    assert result.combinations == ("+1 c",)


def test_a_combination_without_influence_is_written_out_and_its_members_are_infinite():
    J, _ = information()
    J[:, 3] = 2.0 * J[:, 1]
    result = invert_information(J.T @ J, np.ones(4), NAMES)
    assert set(result.uninformed) == {"b", "d"}
    (text,) = result.combinations
    signs = {part.split()[0][0] for part in (text.split(" ", 2)[0], text.split(" ", 2)[2])}
    assert "b" in text and "d" in text and "a" not in text and len(signs) == 2
    kept = J[:, [0, 1, 2]]
    wanted = np.linalg.inv(kept.T @ kept)
    np.testing.assert_allclose(result.covariance[0, 0], wanted[0, 0], rtol=1e-8)
    np.testing.assert_allclose(result.covariance[2, 2], wanted[2, 2], rtol=1e-8)


def test_a_combination_names_small_parameters_beside_large_ones():
    """X_s is of order 1e-9: sizes in SI units must not decide who is named."""
    J, _ = information()
    J[:, 1] = -J[:, 0]
    result = invert_information(J.T @ J, np.array([1e-9, 17.0, 1.0, 1e5]), NAMES)
    (text,) = result.combinations
    assert "a" in text and "b" in text and "c" not in text and "d" not in text
    assert text.startswith("+")


def test_an_almost_singular_direction_is_huge_or_infinite_but_never_small():
    J, _ = information()
    direction = np.random.default_rng(1).standard_normal(30)
    for size in 10.0 ** -np.arange(1, 12):
        J[:, 3] = J[:, 1] + size * direction
        result = invert_information(J.T @ J, np.ones(4), NAMES)
        assert result.std[3] > 0.05 / size or np.isinf(result.std[3])
        assert result.std[0] < 1.0


def test_parameters_at_a_bound_are_left_out_and_named():
    J, _ = information()
    result = invert_information(J.T @ J, np.ones(4), NAMES, at_bound=["b"])
    rest = [0, 2, 3]
    np.testing.assert_allclose(
        result.covariance[np.ix_(rest, rest)], np.linalg.inv(J[:, rest].T @ J[:, rest])
    )
    assert result.at_bound == ("b",) and "b" not in result.uninformed


def test_no_information_at_all_is_infinite_everywhere():
    result = invert_information(np.zeros((4, 4)), np.ones(4), NAMES)
    assert np.isinf(result.std).all() and result.uninformed == NAMES
    np.testing.assert_array_equal(result.correlation, np.eye(4))


def test_rounding_below_zero_counts_as_no_information():
    H = np.diag([4.0, -1e-20])
    result = invert_information(H, np.ones(2), ("a", "b"))
    np.testing.assert_array_equal(result.std, [0.5, np.inf])


def test_correlations_lie_between_minus_one_and_one_and_are_zero_where_unknown():
    J, _ = information()
    J[:, 3] = 0.0
    J[:, 1] = J[:, 0] + 0.1 * J[:, 1]
    correlation = invert_information(J.T @ J, np.ones(4), NAMES).correlation
    np.testing.assert_allclose(np.diag(correlation), 1.0)
    assert correlation[0, 1] < -0.9 and not correlation[3, :3].any()
    assert np.all(np.abs(correlation) <= 1 + 1e-12)


def test_the_robust_covariance_is_the_sandwich_of_all_scores():
    J, H = information()
    rows = np.linspace(0.5, 2.0, len(J))[:, None] * J
    result = invert_information(H, np.full(4, 3.0), NAMES, scores=[[rows], [0.5 * rows]])
    inverse = np.linalg.inv(H)
    wanted = batch_sandwich(inverse, [[rows], [0.5 * rows]])
    np.testing.assert_allclose(result.covariance_robust, 9 * wanted, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "ideal", "robust"), [(0.0, 0.92, 0.92), (0.3, 0.0, 0.82)])
def test_robust_intervals_cover_where_weak_slow_misfit_hides_in_noise(share, ideal, robust):
    rng = np.random.default_rng(7)
    K, tau, runs = 4000, 100.0, 200
    x = np.stack([np.sin(2 * np.pi * np.arange(K) / 700), np.ones(K)], axis=1)
    inverse, a = np.linalg.inv(x.T @ x), np.exp(-1 / tau)
    covered = np.zeros((2, 2))
    for _ in range(runs):
        slow = signal.lfilter([np.sqrt(1 - a**2)], [1, -a], rng.normal(size=K + 1000))[1000:]
        e = rng.normal(size=K) + share * slow
        theta = inverse @ x.T @ e
        e = e - x @ theta
        stds = [
            np.sqrt(np.diag(inverse) * e.var()),
            np.sqrt(np.diag(batch_sandwich(inverse, [[x * e[:, None]]]))),
        ]
        covered += [np.abs(theta) < 1.96 * std for std in stds]
    assert np.all(covered[0] / runs >= ideal) and np.all(covered[1] / runs >= robust)
    if share:
        assert np.all(covered[0] / runs < 0.6)  # which is why the robust one exists


def left_by_a_fit(x, e):
    """Return the influences that the residuals of a least-squares fit leave, and its error."""
    inverse = np.linalg.inv(x.T @ x)
    error = inverse @ x.T @ e
    return (x * (e - x @ error)[:, None]) @ inverse, error


def test_what_a_fit_takes_from_the_residuals_is_counted_by_the_information_of_the_batches():
    """Plain sums over long batches are too small, n / (n - p) of them too large."""
    rng = np.random.default_rng(11)
    K, p, length, runs = 1280, 16, 32, 150
    x = rng.normal(size=(K, p)) * np.linspace(0.2, 2.0, K)[:, None]
    wanted = np.diag(np.linalg.inv(x.T @ x))
    plain, counted = np.zeros(p), np.zeros(p)
    for _ in range(runs):
        rows, _ = left_by_a_fit(x, rng.normal(size=K))
        sums = np.add.reduceat(rows, np.arange(0, K, length), axis=0)
        root, inverse = batches._roots(rows)
        (square,) = batches._squares([rows @ inverse], [length])
        plain += (sums**2).sum(axis=0) / runs / wanted
        counted += ((sums**2).sum(axis=0) + np.sum(root * (square @ root), axis=0)) / runs / wanted
    n = K // length
    assert plain.mean() < 0.97 < 1.2 < plain.mean() * n / (n - p)
    assert counted.mean() == pytest.approx(1.0, abs=0.02)


@pytest.mark.slow
def test_intervals_cover_where_noise_correlates_and_another_kind_of_data_does_not():
    rng = np.random.default_rng(12)
    K, p, runs, correlation = 2000, 6, 80, 0.64
    t = np.arange(K) / K
    x = np.stack([np.sin(2 * np.pi * (i + 1) * t + i) for i in range(p)], axis=1)
    x[:, p // 2 :] *= np.exp(-4 * t)[:, None]  # some hold their information in few batches
    other = np.repeat(0.3 * rng.normal(size=(200, p)), 2, axis=0)
    both = np.concatenate([x, other])
    covered = np.zeros(p)
    for _ in range(runs):
        white = rng.normal(size=K + 100) * np.sqrt(1 - correlation**2)
        slow = signal.lfilter([1.0], [1.0, -correlation], white)[100:]
        rows, error = left_by_a_fit(both, np.concatenate([slow, rng.normal(size=400)]))
        result = batch_sandwich(np.eye(p), [[rows[:K]], [rows[K:]]])
        covered += np.abs(error) < 1.96 * np.sqrt(np.diag(result))
    assert np.all(np.abs(covered / runs - 0.95) < 4 * np.sqrt(0.95 * 0.05 / runs))
    assert covered.mean() / runs == pytest.approx(0.95, abs=0.02)


def test_vectors_without_spread_in_some_directions_have_none_there():
    rows = np.random.default_rng(5).normal(size=(100, 3)) @ np.diag([1.0, 1e-9, 0.0])
    rows = np.column_stack([rows, rows[:, 0]])
    result = batch_sandwich(np.eye(4), [[rows]])
    assert result[2, 2] == 0 and np.all(np.isfinite(result))
    assert result[0, 0] == pytest.approx(result[3, 3]) == pytest.approx(result[0, 3])
    assert result[1, 1] == pytest.approx(1e-18 * result[0, 0], rel=0.5)


def test_records_are_independent_of_each_other_and_of_their_order():
    rng = np.random.default_rng(3)
    parts = [np.cumsum(rng.normal(size=(n, 2)), axis=0) for n in (300, 500, 400)]
    first, second = batch_sandwich(np.eye(2), [parts]), batch_sandwich(np.eye(2), [parts[::-1]])
    np.testing.assert_allclose(first, second, rtol=1e-9)
    assert np.all(np.linalg.eigvalsh(first) > 0)


@pytest.mark.parametrize("level", [0.5, 0.683, 0.95, 0.99])
def test_intervals_cover_as_often_as_they_say(level):
    half = interval_factor(level)
    assert stats.norm.cdf(half) - stats.norm.cdf(-half) == pytest.approx(level)
    assert interval_factor(level, 5) > half
    assert interval_factor(level, 1e7) == pytest.approx(half, rel=1e-4)


class Stated:
    """A bench that states its noise, or does not."""

    def __init__(self, noise):
        self.noise = noise


def record(x):
    return Recording(np.arange(len(x)) / 1e3, {"x": x}, "made", "made", InputHold.ZERO)


@pytest.mark.parametrize("sigma", [1e-6, 1e-4])
def test_noise_that_nobody_stated_is_that_of_all_samples(sigma):
    """As of residuals: that of the noisiest record hid what was left in the others."""
    rng, t = np.random.default_rng(0), np.arange(20_000) / 1e3
    slow = sigma * (500 * np.sin(2 * t) + 2000 * np.sign(np.sin(0.7 * t)))
    levels, sizes = np.array([0.2, 1.0, 0.5]), np.array([20_000, 5_000, 10_000])
    records = [
        record((slow + k * sigma * rng.standard_normal(t.size))[:n])
        for k, n in zip(levels, sizes, strict=True)
    ]
    result = stated_or_estimated_noise(Stated(None), records, "x")
    pooled = sigma * np.sqrt(sizes @ levels**2 / sizes.sum())
    assert result == pytest.approx(pooled, rel=0.05)


def test_noise_that_the_bench_states_is_taken_at_its_word():
    bench = Stated(SensorNoise(p=150.0, x=1.5e-5))
    assert stated_or_estimated_noise(bench, [record(np.zeros(50))], "x") == 1.5e-5


def test_a_channel_without_any_noise_still_has_some():
    for x in (np.zeros(50), np.linspace(0, 1, 50)):
        assert stated_or_estimated_noise(Stated(None), [record(x)], "x") > 0


def test_autocorrelation_is_that_of_the_textbook():
    e = np.random.default_rng(0).standard_normal(4000)
    filtered = np.convolve(e, [1.0, 0.5], "valid")
    result = autocorrelation(filtered, 5)
    d = filtered - filtered.mean()
    typed = [np.sum(d[: d.size - k] * d[k:]) / np.sum(d**2) for k in range(6)]
    np.testing.assert_allclose(result, typed, atol=1e-12)
    assert result[1] == pytest.approx(0.4, abs=0.05)
    assert np.all(np.abs(result[2:]) < 4 / np.sqrt(4000))
