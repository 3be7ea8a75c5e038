"""Profiles: equal to the covariance where the problem is linear, right where it is not."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.output_error import fit_output_error
from pneumo_casadi.estimation.uncertainty import (
    Optimum,
    ProfileEnd,
    profile_likelihood,
    profile_likelihoods,
    profile_path,
)


@pytest.fixture(scope="module")
def profiles(white):
    return profile_likelihoods(white)


def test_where_the_problem_is_nearly_linear_profiles_are_the_gauss_newton_intervals(
    white, profiles
):
    assert set(profiles) == set(white.names)
    for name, profile in profiles.items():
        assert profile.ends == (ProfileEnd.THRESHOLD, ProfileEnd.THRESHOLD)
        assert profile.ratio == pytest.approx((1.0, 1.0), abs=2e-3), name
        assert np.all(np.diff(profile.values) > 0) and set(profile.statuses) == {"converged"}
        for level in (0.5, 0.9):
            np.testing.assert_allclose(
                np.array(profile.interval(level)) - profile.estimate,
                np.array(white.result.interval(name, level)) - profile.estimate,
                rtol=2e-3,
            )


def test_a_derived_quantity_is_profiled_like_a_parameter(white):
    profile = profile_likelihood(white, "F_c")
    assert profile.estimate == pytest.approx(white.result.derived["F_c"].value, rel=1e-6)
    assert profile.std == pytest.approx(white.result.derived["F_c"].std)
    assert profile.ratio == pytest.approx((1.0, 1.0), abs=2e-3)


def test_a_ratio_of_chamber_parameters_is_profiled_beside_a_flow_map(anchored):
    profile = profile_likelihood(anchored, "k_P")
    assert profile.ends == (ProfileEnd.THRESHOLD, ProfileEnd.THRESHOLD)
    assert profile.std_robust != profile.std
    assert profile.ratio == pytest.approx((1.0, 1.0), abs=0.03)
    # k ~ 1/X_s2 is convex in what the data see: the upper side is the longer one.
    assert profile.ratio[1] > profile.ratio[0]


def test_the_cost_is_that_of_a_fit_with_the_parameter_fixed(made, motion, optimum):
    axis, u, x = motion
    record = made.recorded(axis, u[:600], x[:, :600], 3)
    fitted = optimum(axis, [record], reweight=False)
    profile = profile_likelihood(fitted, "f_v")
    for i in (0, -2):
        held = fitted.result.axis.with_parameters({"f_v": float(profile.values[i])})
        held = held.with_parameters(held.parameters.fix("f_v"))
        direct = fit_output_error(held, [record], None, fitted.options)
        assert direct.cost == pytest.approx(float(profile.costs[i]), abs=1e-3)


def test_a_mass_known_badly_has_the_interval_of_its_reciprocal(made, optimum):
    """Without friction x is linear in 1/M, so the interval of 1/M is exact and M's is skew."""
    loose = made.with_noise(made.true_force_axis(), made.SensorNoise(0.0, 4e-3))
    axis = loose.with_parameters(
        {"f_v": 0.0, "F_c_plus": 0.0, "F_c_minus": 0.0},
    )
    u = 60.0 * np.sign(np.sin(60.0 * np.arange(200) / made.FS))[:, None]
    record = made.recorded(axis, u, made.steps(axis, u, [0.0, 0.0]), 0)
    fitted = optimum(made.free_only(axis, "M"), [record], reweight=False)
    profile = profile_likelihood(fitted, "M")
    M, z = profile.estimate, 1.959964
    reciprocal = z * profile.std / M**2
    wanted = (1 / (1 / M + reciprocal), 1 / (1 / M - reciprocal))
    assert reciprocal * M > 0.15  # far from linear
    np.testing.assert_allclose(profile.interval(), wanted, rtol=1e-3)
    assert profile.ratio[1] > 1.1 and profile.ratio[0] < 0.9


@pytest.mark.slow
def test_what_the_data_say_nothing_about_has_an_infinite_interval(one_way):
    for name in ("F_c_minus", "F_c"):
        profile = profile_likelihood(one_way, name)
        assert profile.interval() == (-np.inf, np.inf) == profile.interval(robust=True)
        assert profile.ends == (ProfileEnd.FLAT, ProfileEnd.FLAT) and profile.ratio == (1.0, 1.0)
        assert np.ptp(profile.costs) < 1e-3
    informed = profile_likelihood(one_way, "f_v")
    assert np.isfinite(informed.interval()).all()


def test_a_side_that_ends_at_a_bound_is_open(made, motion, optimum):
    axis, u, x = motion
    loose = made.with_noise(axis, made.SensorNoise(0.0, 3e-3))
    record = made.recorded(loose, u[:300], x[:, :300], 2)
    fitted = optimum(made.free_only(loose, "M", "f_v"), [record], reweight=False)
    profile = profile_likelihood(fitted, "f_v")
    assert profile.ends == (ProfileEnd.BOUND, ProfileEnd.THRESHOLD)
    assert profile.values[0] == 0.0 and profile.costs[0] > profile.costs.min()
    low, high = profile.interval()
    assert low == -np.inf and profile.estimate < high < np.inf


def test_correlated_residuals_widen_the_robust_interval_as_the_sandwich_says(coloured):
    profile = profile_likelihood(coloured, "M")
    np.testing.assert_allclose(profile.interval(robust=True), profile.gauss_newton(robust=True))
    narrow, wide = np.ptp(profile.interval()), np.ptp(profile.interval(robust=True))
    assert wide / narrow == pytest.approx(profile.std_robust / profile.std, rel=1e-2)
    assert wide > 1.5 * narrow


def test_profiles_do_not_depend_on_who_takes_them(white, profiles):
    with ThreadPoolExecutor(2) as executor:
        by_threads = profile_likelihoods(white, ["M", "f_v"], executor=executor)
    for name, profile in by_threads.items():
        np.testing.assert_array_equal(profile.values, profiles[name].values)
        np.testing.assert_allclose(profile.costs, profiles[name].costs, rtol=1e-12)


def test_a_lower_cost_than_that_of_the_fit_is_an_error(white, monkeypatch):
    cost = Optimum.cost
    monkeypatch.setattr(
        Optimum,
        "cost",
        lambda self, problem, s: cost(self, problem, s) + (5.0 if s is self.solution else 0.0),
    )
    with pytest.raises(FitError, match="fit again from there") as caught:
        profile_likelihood(white, "M")
    assert caught.value.partial.name == "M"


def test_a_refit_that_fails_is_on_record_and_leaves_its_side_open(white, monkeypatch):
    solve = profile_path.solve_from

    def failing(optimum, problem, point):
        solution = solve(optimum, problem, point)
        heavy = point.theta[0] > white.result.parameters["M"].value + 0.8 * white.result.std("M")
        return replace(solution, status="no step helps") if heavy else solution

    monkeypatch.setattr(profile_path, "solve_from", failing)
    profile = profile_likelihood(white, "M")
    assert profile.ends == (ProfileEnd.THRESHOLD, ProfileEnd.FAILED)
    assert profile.interval()[0] > 0 and profile.interval()[1] == np.inf
    failed = [s for s in profile.statuses if s != "converged"]
    assert failed and set(failed) == {"no step helps"}
    assert np.isinf(profile.costs[-1])


def test_what_cannot_be_profiled_is_refused(made, motion, white, profiles, optimum):
    with pytest.raises(ModelError, match=r"levels up to 0\.95"):
        profiles["M"].interval(0.99)
    with pytest.raises(ModelError, match="no parameter and no derived quantity 'k_P'"):
        profile_likelihood(white, "k_P")
    with pytest.raises(ModelError, match="v_s was held fixed"):
        profile_likelihood(white, "v_s")
    axis, u, x = motion
    other = replace(white, records=[made.recorded(axis, u, x, 9)])
    with pytest.raises(ModelError, match="not those of the fit"):
        profile_likelihood(other, "M")
    with pytest.raises(FitError, match="no uncertainty without an optimum"):
        replace(white, result=replace(white.result, status="iterations exhausted"))
