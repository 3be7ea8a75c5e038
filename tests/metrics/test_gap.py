"""Noise floor, gap and closure."""

from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.metrics import (
    RowGains,
    balance_noise,
    closure,
    closure_interval,
    combined_gap,
    gap,
    resampling_weights,
)


def test_errors_of_pure_noise_leave_no_gap_and_model_error_adds_to_noise_in_squares():
    assert gap(0.9, 1.0) == 0.0
    assert gap(np.array([1.0, 5.0]), 1.0, signal=4.0) == pytest.approx([0.0, 0.5])


def test_a_margin_widens_the_floor():
    assert gap(1.1**2, 1.0, margin=1.1) == pytest.approx(0.0, abs=1e-7)
    assert gap(1.2**2, 1.0, margin=1.1) == pytest.approx(np.sqrt(1.44 - 1.21))


def test_the_gap_of_several_channels_is_their_root_mean_square():
    assert combined_gap([0.0, 3.0, 0.0]) == pytest.approx(np.sqrt(3.0))


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [(2.0, 0.5, 0.75), (2.0, 2.0, 0.0), (2.0, 3.0, -0.5), (0.0, 1.0, 0.0)],
)
def test_closure(before, after, expected):
    assert closure(before, after) == pytest.approx(expected)


def interval(before, after, replicates=2000):
    ones = np.ones_like(before)
    return closure_interval(before, after, ones, np.zeros(1), np.ones(1), replicates)


def test_blocks_that_close_alike_leave_no_uncertainty():
    errors = np.random.default_rng(1).exponential(size=(1, 50))
    assert interval(errors, errors / 4) == pytest.approx((0.5, 0.5))


@pytest.mark.slow
def test_the_interval_covers_the_closure_as_often_as_it_says():
    """Independent errors before and after with a true closure of one half."""
    rng = np.random.default_rng(2)
    covered = 0
    for _ in range(200):
        before, after = rng.exponential(4.0, (1, 60)), rng.exponential(1.0, (1, 60))
        lower, upper = interval(before, after, 400)
        covered += lower < 0.5 < upper
    assert 0.88 < covered / 200 < 0.99


def test_channels_without_importance_do_not_count():
    before, after = np.full((2, 10), 4.0), np.array([[1.0] * 10, [400.0] * 10])
    ones = np.ones((2, 10))
    ends = closure_interval(before, after, ones, np.zeros(2), np.array([1.0, 0.0]), 100)
    assert ends == pytest.approx((0.5, 0.5))


def test_replicates_without_a_gap_close_nothing():
    """Of three quiet blocks and a loud one many have none: each counted as infinitely worse."""
    before = np.array([[0.5, 0.5, 0.5, 9.0]])
    ones = np.ones_like(before)
    lower, upper = closure_interval(before, 0.6 * before, ones, np.ones(1), np.ones(1), 200)
    assert lower == 0.0 and 0.0 < upper < 1.0


def test_every_replicate_draws_as_many_blocks_as_there_are():
    weights = resampling_weights(7, 50)
    assert weights.shape == (50, 7)
    assert set(weights.sum(axis=1)) == {7.0}


def test_the_noise_floor_of_balances_has_each_sensor_through_its_filter():
    servo = SimpleNamespace(noise=np.array([100.0, 50.0, 1e-5]))
    gains = RowGains(level=0.5, rate=10.0, acceleration=2000.0)
    assert balance_noise(servo, gains, mass=15.0) == pytest.approx([1000.0, 500.0, 0.3])
    with_pressures = balance_noise(servo, gains, mass=15.0, areas=(8e-3, 0.0))
    assert with_pressures == pytest.approx([1000.0, 500.0, 0.5])
    with_velocity = balance_noise(servo, gains, 15.0, velocity_slopes=(7.5e6, 0.0))
    assert with_velocity == pytest.approx([1250.0, 500.0, 0.3])
    driven = SimpleNamespace(noise=np.array([1e-5]))
    assert balance_noise(driven, gains, mass=1.0) == pytest.approx([0.02])


def test_the_floor_of_a_servo_axis_is_a_force_that_of_a_force_driven_one_an_acceleration():
    from pneumo_casadi.data.bench.axis_kind import FORCE_DRIVEN, PNEUMATIC
    from pneumo_casadi.diagnosis.metrics.residual_size import force_row_scale

    assert force_row_scale(PNEUMATIC, 15.0) == 1.0
    assert force_row_scale(FORCE_DRIVEN, 15.0) == 15.0


def test_where_there_was_no_gap_nothing_is_closed():
    errors, ones = np.full((2, 40), 0.5), np.ones((2, 40))
    assert closure_interval(errors, errors, ones, np.ones(2), np.zeros(2), 100) == (0.0, 0.0)
