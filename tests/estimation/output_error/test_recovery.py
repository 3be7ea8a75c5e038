"""The truth lies within the intervals, whoever solves and from wherever."""

import numpy as np
import pytest
from scipy import stats

from pneumo_casadi.data import InputHold, SensorNoise
from pneumo_casadi.effects import Stribeck
from pneumo_casadi.estimation.output_error import Method, OutputErrorOptions, fit_output_error

SEEDS = range(8)


@pytest.fixture(scope="module")
def seeds(fit):
    return [fit(seed) for seed in SEEDS]


def deviations(result, truth):
    names = result.uncertainty.names
    return np.array([result.parameters[n].value - truth[n] for n in names])


def assert_same(one, other, share):
    """Assert two fits equal within a share of a standard deviation."""
    names = one.uncertainty.names
    apart = np.array([one.parameters[n].value - other.parameters[n].value for n in names])
    worst = np.abs(apart / one.uncertainty.std).max()
    assert worst < share, dict(zip(names, apart / one.uncertainty.std, strict=True))


@pytest.mark.slow
def test_the_truth_lies_within_the_reported_covariance_over_seeds(servo, seeds):
    truth = servo[0].parameters.as_dict()
    chi2 = 0.0
    for result in seeds:
        d = deviations(result, truth)
        assert d.size == 22
        chi2 += d @ np.linalg.solve(result.uncertainty.covariance, d)
    assert 1e-3 < stats.chi2.sf(chi2, 22 * len(seeds)) < 1 - 1e-3


@pytest.mark.slow
def test_each_parameter_scatters_as_its_standard_deviation_says(servo, seeds):
    truth = servo[0].parameters.as_dict()
    z = np.array([deviations(r, truth) / r.uncertainty.std for r in seeds])
    low, high = stats.chi2.ppf([1e-4, 1 - 1e-4], len(seeds))
    squares = (z**2).sum(axis=0)
    assert np.all((squares > low) & (squares < high)), squares
    inside = np.mean(np.abs(z) < 1.96)
    assert 0.88 < inside < 0.99


@pytest.mark.slow
def test_ratios_of_specific_heats_come_with_intervals_that_hold(servo, seeds):
    p = servo[0].parameters.as_dict()
    for name, truth in (("k_P", p["X_s3"] / p["X_s2"]), ("k_N", p["X_s6"] / p["X_s5"])):
        z = np.array([(r.derived[name].value - truth) / r.derived[name].std for r in seeds])
        assert stats.chi2.ppf(1e-4, len(z)) < np.sum(z**2) < stats.chi2.ppf(1 - 1e-4, len(z))


@pytest.mark.slow
def test_the_noise_of_each_sensor_is_found(made, seeds):
    wanted = [made.NOISE.p, made.NOISE.p, made.NOISE.x]
    mean = np.mean([result.sigma for result in seeds], axis=0)
    np.testing.assert_allclose(mean, wanted, rtol=0.03)


def test_wrong_stated_noise_does_not_change_the_answer_much(made, fitted, servo, start):
    axis, u, x = servo
    table, begin = start(0)
    wrong = made.with_noise(begin, SensorNoise(p=600.0, x=5e-6))
    options = OutputErrorOptions(widths=(made.TRUE["v_s"],))
    result = fit_output_error(wrong, [made.recorded(axis, u, x, 0)], table, options)
    np.testing.assert_allclose(result.sigma, fitted.sigma, rtol=0.02)
    assert_same(fitted, result, 0.1)


@pytest.mark.slow
def test_ipopt_and_gauss_newton_find_the_same_optimum(fit, fitted):
    ipopt = fit(method=Method.IPOPT)
    assert ipopt.status == "converged"
    assert ipopt.cost == pytest.approx(fitted.cost, rel=1e-6)
    assert_same(fitted, ipopt, 1e-3)
    np.testing.assert_allclose(ipopt.uncertainty.std, fitted.uncertainty.std, rtol=1e-3)


@pytest.mark.slow
def test_starts_30_percent_off_reach_the_same_optimum(made, servo, start, fitted):
    axis, u, x = servo
    rng = np.random.default_rng(0)
    names = [n for n in made.TRUE if n != "v_s"]
    table, begin = start(0)
    begin = made.perturbed(begin, dict(zip(names, rng.uniform(0.7, 1.3, len(names)), strict=True)))
    options = OutputErrorOptions(widths=(made.TRUE["v_s"],))
    result = fit_output_error(begin, [made.recorded(axis, u, x, 0)], table, options)
    assert_same(fitted, result, 0.02)
    assert result.flow_map_deviation.rms == pytest.approx(fitted.flow_map_deviation.rms, rel=1e-3)


@pytest.mark.slow
def test_the_length_of_blocks_does_not_matter(fit, fitted):
    result = fit(block=1e-2)
    assert_same(fitted, result, 0.3)
    np.testing.assert_allclose(result.uncertainty.std, fitted.uncertainty.std, rtol=0.12)


def test_windows_cost_information_and_bias_nothing(servo, fit, fitted):
    result = fit(window=0.3)
    assert len(result.segments) == 4 and len(result.initial_states) == 4
    assert np.all(result.uncertainty.std > 0.98 * fitted.uncertainty.std)
    d = deviations(result, servo[0].parameters.as_dict())
    chi2 = d @ np.linalg.solve(result.uncertainty.covariance, d)
    assert stats.chi2.sf(chi2, d.size) > 1e-4


def test_windows_cut_at_the_same_places_as_separate_records_give_the_same_fit(
    made, servo, start, fit
):
    axis, u, x = servo
    record = made.recorded(axis, u, x, 0)
    table, begin = start(0)
    options = OutputErrorOptions(widths=(made.TRUE["v_s"],))
    halves = [record.window(0.0, 0.601), record.window(0.6, 1.2)]
    apart = fit_output_error(begin, halves, table, options)
    windows = fit(window=0.6)
    assert [s.K for s in apart.segments] == [s.K for s in windows.segments]
    np.testing.assert_allclose(apart.sigma, windows.sigma, rtol=0.02)
    # The starts of the states differ, the optimum does not.
    assert_same(windows, apart, 0.02)


@pytest.mark.slow
def test_two_records_hold_twice_the_information_of_one(made, servo, start):
    axis, u, x = servo
    record = made.recorded(axis, u, x, 0)
    _, begin = start(0)
    begin = begin.with_parameters(begin.parameters.fix(*begin.flow.parameters.names))
    options = OutputErrorOptions(widths=(made.TRUE["v_s"],))
    one = fit_output_error(begin, [record], None, options)
    two = fit_output_error(begin, [record, record], None, options)
    np.testing.assert_allclose(two.uncertainty.std * np.sqrt(2), one.uncertainty.std, rtol=5e-3)
    assert_same(one, two, 0.05)
    assert len(two.fitted) == 2 and two.fitted[0].shape == one.fitted[0].shape


def test_nothing_given_is_changed(made, servo, start):
    axis, u, x = servo
    record = made.recorded(axis, u[:400], x[:, :400], 0)
    table, begin = start(0)
    channels = {n: record[n].copy() for n in record.names}
    before, q_m = begin.parameters, table.q_m.copy()
    result = fit_output_error(
        begin, [record], table, OutputErrorOptions(widths=(made.TRUE["v_s"],), window=0.2)
    )
    assert begin.parameters == before and result.parameters != before
    np.testing.assert_array_equal(table.q_m, q_m)
    for name, values in channels.items():
        np.testing.assert_array_equal(record[name], values)


def test_fitted_outputs_are_a_simulation_from_the_reported_initial_state(made, fitted, servo):
    _, u, _ = servo
    (segment,) = fitted.segments
    path = made.steps(fitted.axis, u, fitted.initial_states[0], substeps=1)
    n, K = segment.n, segment.K
    mean = path[:3, : n * K].reshape(3, K, n).mean(axis=2)
    apart = np.abs(fitted.fitted[0] - mean).max(axis=1)
    assert np.all(apart < 0.02 * fitted.sigma)


@pytest.mark.parametrize("by", [-1, 1])
def test_outputs_shifted_by_one_sample_fit_measurably_worse(made, servo, fit, fitted, by):
    axis, u, x = servo
    record = made.recorded(axis, u, x, 0)
    moved = record
    for channel in axis.outputs:
        moved = moved.shifted(channel, by)
    result = fit(record=moved)
    assert result.sigma[2] > 1.1 * fitted.sigma[2]
    assert (
        np.abs(deviations(result, servo[0].parameters.as_dict()) / result.uncertainty.std).max() > 8
    )


@pytest.mark.slow
def test_linear_and_zero_hold_are_not_confused(made, servo):
    axis, u, _ = servo
    x = made.steps(axis, u[:800], servo[2][:, 0], InputHold.LINEAR)
    record = made.recorded(axis, u[:800], x, 0, hold=InputHold.LINEAR)
    begin = made.free_only(axis, "X_s1", "X_s2", "X_s4", "X_s5", "M", "f_v")
    options = OutputErrorOptions(widths=(made.TRUE["v_s"],))
    right = fit_output_error(begin, [record], None, options)
    held = made.recorded(axis, u[:800], x, 0, hold=InputHold.ZERO)
    wrong = fit_output_error(begin, [held], None, options)
    truth = axis.parameters.as_dict()
    d = deviations(right, truth)
    assert stats.chi2.sf(d @ np.linalg.solve(right.uncertainty.covariance, d), d.size) > 1e-3
    d = deviations(wrong, truth)
    assert stats.chi2.sf(d @ np.linalg.solve(wrong.uncertainty.covariance, d), d.size) < 1e-6


@pytest.mark.slow
def test_effects_with_and_without_states_are_recovered_with_the_axis(made, start):
    effects = (made.ValveLag(), Stribeck())
    values = {"valve_lag.tau": 8e-3, "stribeck.delta_F": 12.0, "stribeck.v_stribeck": 0.03}
    axis = made.true_axis(*effects).with_parameters(values)
    u, x = made.controlled(axis, 1000)
    record = made.recorded(axis, u, x, 3)
    table, begin = start(3)
    begin = begin.with_effects(*effects).with_parameters(
        {"valve_lag.tau": 3e-3, "stribeck.delta_F": 6.0}
    )
    result = fit_output_error(
        begin, [record], table, OutputErrorOptions(widths=(made.TRUE["v_s"],))
    )
    truth = axis.parameters.as_dict()
    d = deviations(result, truth)
    assert {*values} <= {*result.uncertainty.names}
    chi2 = d @ np.linalg.solve(result.uncertainty.covariance, d)
    assert 1e-3 < stats.chi2.sf(chi2, d.size) < 1 - 1e-4
    assert result.parameters["valve_lag.tau"].value == pytest.approx(8e-3, rel=0.05)


@pytest.mark.slow
def test_a_spline_map_serves_a_fit_with_one_gain(made):
    axis = made.spline_axis()
    u, x = made.controlled(axis, 1000, substeps=4)
    table = made.smooth_map()
    begin = made.perturbed(axis, {"X_s1": 1.1, "X_s6": 0.9, "M": 1.1})
    result = fit_output_error(
        begin,
        [made.recorded(axis, u, x, 0)],
        table,
        OutputErrorOptions(widths=(made.TRUE["v_s"],)),
    )
    d = deviations(result, axis.parameters.as_dict())
    assert "flow_gain" in result.uncertainty.names
    assert stats.chi2.sf(d @ np.linalg.solve(result.uncertainty.covariance, d), d.size) > 1e-3


@pytest.mark.parametrize("method", list(Method))
def test_the_force_axis_gives_back_its_mass_and_friction(made, force, method):
    axis, u, x = force
    begin = made.ForceAxis(made.FORCE_BENCH)  # mass and friction of no particular truth
    options = OutputErrorOptions(widths=(made.FORCE_TRUE["v_s"],), method=method)
    chi2, runs = 0.0, 4 if method is Method.GAUSS_NEWTON else 1
    for seed in range(runs):
        result = fit_output_error(begin, [made.recorded(axis, u, x, seed)], options=options)
        d = deviations(result, made.FORCE_TRUE)
        chi2 += d @ np.linalg.solve(result.uncertainty.covariance, d)
        assert result.flow_map_deviation is None and set(result.derived) == {"F_c", "F_offset"}
        assert np.all(np.abs(d / [18.0, 25.0, 12.0, 17.0]) < 1e-3)
    assert 1e-3 < stats.chi2.sf(chi2, 4 * runs) < 1 - 1e-3


def test_the_answer_does_not_hang_on_how_weak_friction_was_at_the_start(made, force):
    """Steps must be as fine as the friction found needs, not the friction begun with."""
    axis, u, x = force
    record = made.recorded(axis, u, x, 0)
    options = OutputErrorOptions(widths=(4e-4,))
    weak = axis.with_parameters({"F_c_plus": 0.1, "F_c_minus": 0.1})
    one, two = (fit_output_error(a, [record], options=options) for a in (axis, weak))
    np.testing.assert_allclose(one.sigma, two.sigma, rtol=1e-3)
    assert_same(one, two, 0.05)
