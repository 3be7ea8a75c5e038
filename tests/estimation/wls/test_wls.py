import json

import casadi as ca
import numpy as np
import pytest

from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.wls import (
    StickPhases,
    cross_validate,
    evaluate_regressor,
    fit_wls,
    format_table,
    results_table,
)
from pneumo_casadi.estimation.wls.regressor import _decimated, _smooth_edged
from pneumo_casadi.parameters import Parameter, Parameters
from pneumo_casadi.signals import FilterPlan, InputPairing, filter_recording, parallel_decimate

PLAN = FilterPlan(1e3, cutoff=60.0, factor=25, f_dyn=2.0)


@pytest.fixture(scope="module")
def clean(made):
    return fit_wls(made.Eq7(), made.smooth_record(1), plan=PLAN)


def test_a_record_that_obeys_eq_7_gives_its_parameters_back(made, clean):
    np.testing.assert_allclose(clean.estimate / list(made.TRUE.values()), 1.0, atol=2e-3)
    assert max(clean.relative_error_percent.values()) < 0.5
    assert clean.out_of_bounds == () and clean.removed == ()


def test_polytropic_coefficients_are_the_ratios_of_their_parameters(made, clean):
    P = made.TRUE
    assert clean.derived.names == ("k_P", "k_N")
    expected = [P["X_s3"] / P["X_s2"], P["X_s6"] / P["X_s5"]]
    np.testing.assert_allclose(clean.derived.values, expected, atol=3e-3)


def test_noise_widens_the_intervals_and_they_hold_the_truth(made, clean):
    noisy = fit_wls(made.Eq7(), made.smooth_record(1, noise=0.1), plan=PLAN)
    assert np.all(noisy.std > 2 * clean.std)
    gap = (noisy.estimate - list(made.TRUE.values())) / noisy.std
    assert np.abs(gap).max() < 4


def test_several_records_are_stacked(made):
    pair = [made.smooth_record(2), made.smooth_record(3)]
    both = fit_wls(made.Eq7(), pair, plan=PLAN)
    single = fit_wls(made.Eq7(), pair[0], plan=PLAN)
    assert both.rows_used["mass_flow_P"] == 2 * single.rows_used["mass_flow_P"]
    assert set(both.samples_dropped) == {"smooth2", "smooth3"}


def test_samples_at_rest_ruin_friction_unless_left_out(made):
    rec = made.record_with_rests()
    truth = np.array([made.TRUE[name] for name in ("f_v", "F_c_plus", "F_c_minus")])
    worst = {}
    for stick in StickPhases:
        fit = fit_wls(made.Eq7(), rec, plan=PLAN, stick=stick)
        worst[stick] = np.abs(fit.estimate[7:] / truth - 1).max()
    assert worst[StickPhases.OMIT] < 0.03
    assert worst[StickPhases.KEEP] > 0.2


def test_what_was_left_out_is_counted(made):
    fit = fit_wls(made.Eq7(), made.record_with_rests(), plan=PLAN)
    assert fit.rows_dropped["mass_flow_P"] == 1  # at the end of the record
    assert fit.rows_dropped["force"] >= 4000 // PLAN.factor
    total = {fit.rows_used[name] + fit.rows_dropped[name] for name in fit.rows_used}
    assert len(total) == 1
    assert fit.velocity_threshold["rests"] > 0


class WithUselessColumns:
    """Eq. 7 with two columns more that the data do not support."""

    def __init__(self, model):
        self._model = model
        self.equations, self.motion_states = model.equations, model.motion_states
        self.inputs = model.inputs
        self.regressor_names = (*model.regressor_names, "drag", "spring")
        extra = Parameters(
            [Parameter("drag", 0.0, "SI", lower=0.0), Parameter("spring", 0.0, "SI")]
        )
        self.parameters = model.parameters + extra

    def regressor(self, names=None):
        names = names or self.regressor_names
        x, dx, u = ca.SX.sym("x", 4), ca.SX.sym("dx", 4), ca.SX.sym("u", 3)
        Y, W = self._model.regressor()(x, dx, u)
        columns = {n: W[:, i] for i, n in enumerate(self._model.regressor_names)}
        columns["drag"] = ca.vertcat(0, 0, x[3] * ca.fabs(x[3]))
        columns["spring"] = ca.vertcat(0, 0, x[2])
        return ca.Function(
            "w", [x, dx, u], [Y, ca.densify(ca.horzcat(*(columns[n] for n in names)))]
        )


def test_parameters_that_the_data_do_not_support_are_removed_one_at_a_time_and_listed(made):
    model = WithUselessColumns(made.Eq7())
    rec = made.smooth_record(4, noise=0.3)
    kept = fit_wls(model, rec, plan=PLAN)
    assert kept.removed == () and len(kept.names) == 12
    fit = fit_wls(model, rec, plan=PLAN, remove_above=10.0)
    assert {item.name for item in fit.removed} == {"drag", "spring"}
    assert all(item.relative_std_percent >= 10.0 for item in fit.removed)
    assert fit.names == made.Eq7.regressor_names
    assert np.all(fit.relative_std_percent < 10.0)
    assert "removed drag" in format_table(fit)
    assert all(item.error_after >= item.error_before for item in fit.removed)


def test_an_estimate_that_physics_excludes_is_kept_and_named(made, clean):
    fit = fit_wls(_Bounded(made.Eq7(), "M", upper=10.0), made.smooth_record(1), plan=PLAN)
    assert fit.out_of_bounds == ("M",)
    assert fit.parameters["M"].value == pytest.approx(clean.parameters["M"].value, rel=1e-12)
    assert "M: outside its physical bounds" in format_table(fit)


class _Bounded:
    def __init__(self, model, name, upper):
        self._model = model
        self.parameters = model.parameters.with_values({name: upper}).bounded(name, 0.0, upper)

    def __getattr__(self, name):
        return getattr(self._model, name)


def test_flows_and_effort_of_another_record_are_predicted(made, clean):
    (result,) = cross_validate(clean, made.smooth_record(9))
    assert set(result.measured) == set(made.Eq7.equations)
    assert max(result.relative_error_percent.values()) < 0.5
    for name, measured in result.measured.items():
        assert measured.shape == result.predicted[name].shape == result.t.shape
        rho = (measured - result.predicted[name])[result.used[name]]
        expected = 100 * np.linalg.norm(rho) / np.linalg.norm(measured[result.used[name]])
        assert result.relative_error_percent[name] == pytest.approx(expected)


def test_the_error_of_effort_in_motion_is_free_of_what_rests_do_to_it(made):
    record = made.record_with_rests()
    fit = fit_wls(made.Eq7(), record, plan=PLAN)
    (result,) = cross_validate(fit, record)
    assert result.relative_error_percent["force"] < 1.0
    assert result.relative_error_percent_all["force"] > 5.0


@pytest.mark.parametrize(("stick", "counts"), [(StickPhases.OMIT, False), (StickPhases.KEEP, True)])
def test_the_ends_of_a_record_do_not_count_unless_all_samples_are_kept_alike(made, stick, counts):
    record = made.smooth_record(1)
    fit = fit_wls(made.Eq7(), record, plan=PLAN, stick=stick)
    (result,) = cross_validate(fit, record)
    for used in result.used.values():
        assert bool(used[-1]) is counts and used[1:-1].sum() > len(used) // 3


def test_the_noise_of_accelerations_cancels_in_all_rows_not_where_a_record_breaks_off():
    acceleration = np.diff(np.random.default_rng(5).normal(size=(2003, 100)), 2, axis=0)
    window = _smooth_edged(np.ones(2001, dtype=bool), PLAN.factor)
    plain = parallel_decimate(acceleration, PLAN.factor).std(axis=1)
    windowed = _decimated(acceleration * window[:, None], PLAN).std(axis=1)
    inside = np.median(plain)
    assert plain[0] > 100 * inside and windowed.max() < 3 * inside


def test_the_table_is_the_papers(clean):
    table = results_table(clean)
    assert list(table.columns) == ["X̂", "2σ", "%σ_r"]
    assert table.index.name == "Parameters (ISO units)"
    np.testing.assert_allclose(table["%σ_r"], 50 * table["2σ"] / table["X̂"].abs())
    text = format_table(clean, robust=True)
    assert "3.49e-009" in text and "1.69e+001" in text and "2σ (HAC)" in text
    assert "force: relative error" in text and "k_P = " in text


def test_records_of_the_same_name_are_told_apart(made):
    rec = made.smooth_record(2)
    fit = fit_wls(made.Eq7(), [rec, rec], plan=PLAN)
    assert set(fit.samples_dropped) == {"smooth2 (1)", "smooth2 (2)"}


def test_the_result_goes_to_json_and_cannot_be_changed(clean):
    content = json.loads(json.dumps(clean.as_dict()))
    assert content["parameters"]["M"]["value"] == pytest.approx(16.9, rel=2e-3)
    assert set(content["derived"]) == {"k_P", "k_N"}
    with pytest.raises(ValueError, match="read-only"):
        clean.estimate[0] = 0.0


def test_no_record_is_refused(made):
    with pytest.raises(ModelError, match="no record"):
        fit_wls(made.Eq7(), [])


def test_the_regressor_is_averaged_over_the_inputs_around_a_sample(made):
    rec = made.smooth_record(1, N=3000)
    filtered = filter_recording(rec, PLAN, InputPairing.MEAN_OF_HOLDS)
    Y, W = evaluate_regressor(made.Eq7(), filtered, made.Eq7.regressor_names)
    kept = np.arange(filtered.dropped[0], rec.N - filtered.dropped[1])
    np.testing.assert_allclose(Y[0], (rec["u_P"][kept - 1] + rec["u_P"][kept]) / 2, rtol=1e-12)
    x, v = filtered.states["x"], filtered.states["v"]
    np.testing.assert_allclose(W[0, :, 1], x * filtered.derivatives["p_P"], rtol=1e-12)
    np.testing.assert_allclose(W[1, :, 5], -v * filtered.states["p_N"], rtol=1e-12)
