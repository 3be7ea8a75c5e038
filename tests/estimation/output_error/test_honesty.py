"""What the data do not say is not said: bounds, missing information, failures, the gauge."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from pneumo_casadi.data import InputHold, Recording, ValveData, Valves
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.flow_anchor import anchor_flow
from pneumo_casadi.estimation.output_error import Method, OutputErrorOptions, fit_output_error
from pneumo_casadi.estimation.output_error.result import flow_map_deviation
from pneumo_casadi.estimation.output_error.stages import write_problem

METHODS = list(Method)


def options(made, **given):
    return OutputErrorOptions(**({"widths": (made.TRUE["v_s"],)} | given))


@pytest.fixture(scope="module")
def short(made, servo):
    axis, u, x = servo
    return made.recorded(axis, u[:400], x[:, :400], 0)


@pytest.mark.slow
def test_flow_and_chambers_free_without_a_map_are_refused(made, start, short):
    _, begin = start(0)
    with pytest.raises(ModelError, match="one constant changes no trajectory"):
        fit_output_error(begin, [short], None, options(made))
    held = begin.with_parameters(begin.parameters.fix(*begin.flow.parameters.names))
    result = fit_output_error(held, [short], None, options(made))
    assert result.flow_map_deviation is None and "X_s1" in result.uncertainty.names


@pytest.mark.slow
def test_without_the_refusal_the_gauge_would_be_an_uninformed_direction(
    made, start, servo, fitted, monkeypatch
):
    """The statistics see the gauge too, should anyone pass by the refusal."""
    axis, u, x = servo
    record = made.recorded(axis, u, x, 0)
    _, begin = start(0)
    chambers = [f"X_s{i}" for i in range(1, 7)]
    monkeypatch.setattr(
        "pneumo_casadi.estimation.output_error.stages._refuse_free_gauge", lambda *a: None
    )
    result = fit_output_error(begin, [record], None, options(made))
    loose = min(result.std(n) / result.parameters[n].value for n in chambers)
    tight = fitted.std("X_s6") / fitted.parameters["X_s6"].value  # beside the map
    assert np.isinf(loose) or loose > 100 * tight


def test_one_record_need_not_stand_in_a_list(made, start, short):
    table, begin = start(0)
    held = begin.with_parameters(begin.parameters.fix_all())
    with pytest.raises(ModelError, match="no parameter is free"):  # and not: no channel `0`
        fit_output_error(held, short, table, options(made))


def test_records_that_do_not_fit_together_are_refused(made, start, short):
    table, begin = start(0)
    with pytest.raises(ModelError, match="differ in sampling frequency"):
        fit_output_error(begin, [short, short.decimate(2)], table, options(made))
    # One model would accelerate it by 0.2 % too much.
    slower = Recording(1.001 * short.t, short.channels, "slower", "memory", short.hold)
    with pytest.raises(ModelError, match='state "clock": "as recorded"'):
        fit_output_error(begin, [short, slower], table, options(made))
    with pytest.raises(ModelError, match="no record"):
        fit_output_error(begin, [], table, options(made))
    with pytest.raises(ModelError, match="no parameter is free"):
        fit_output_error(
            begin.with_parameters(begin.parameters.fix_all()), [short], table, options(made)
        )
    with pytest.raises(ModelError, match="do not fill one block"):
        fit_output_error(begin, [short], table, options(made, block=0.5))
    tiny = short.window(0.0, 0.004)
    with pytest.raises(ModelError, match="too few"):
        fit_output_error(begin, [tiny], table, options(made))


def test_records_whose_clocks_differ_by_what_jitter_moves_them_are_fitted_together(
    made, start, short
):
    table, begin = start(0)
    rng = np.random.default_rng(1)
    jittered = [
        Recording(
            short.t + 0.01 * short.dt * rng.uniform(-1, 1, short.N),
            short.channels,
            f"run {number}",
            "memory",
            short.hold,
        )
        for number in range(2)
    ]
    assert abs(jittered[0].dt / jittered[1].dt - 1) > 1e-9
    problem = write_problem(begin, jittered, table, options(made))
    assert {segment.record for segment in problem.segments} == {0, 1}


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_a_parameter_at_its_bound_is_named(made, force, method):
    axis, u, x = force
    u, x = u[:800], x[:, :800]
    p = axis.parameters.with_values({"f_v": 15.0}).bounded("f_v", 0.0, 20.0)
    record = made.recorded(axis, u, x, 0)
    result = fit_output_error(axis.with_parameters(p), [record], None, options(made, method=method))
    assert result.uncertainty.at_bound == ("f_v",)
    assert result.parameters["f_v"].value == pytest.approx(20.0, abs=1e-6)
    inside = axis.with_parameters(p.with_values({"f_v": 20.0}).fix("f_v"))
    held = fit_output_error(inside, [record], None, options(made, method=method))
    for name in ("M", "F_c_plus", "F_c_minus"):
        assert abs(result.parameters[name].value - held.parameters[name].value) < 0.02 * held.std(
            name
        )
        assert result.std(name) == pytest.approx(held.std(name), rel=5e-3)


@pytest.mark.parametrize("method", METHODS)
def test_forward_motion_says_nothing_about_friction_backward(made, force, method):
    axis, *_ = force
    u = 60.0 + 30.0 * np.sin(25.0 * np.arange(500) / made.FS)[:, None]
    x = made.steps(axis, u, [-0.2, 0.3])
    assert x[1].min() > 0.15
    record = made.recorded(axis, u, x, 0)
    result = fit_output_error(axis, [record], None, options(made, method=method))
    assert result.uncertainty.uninformed == ("F_c_minus",)
    assert result.std("F_c_minus") == np.inf
    assert result.interval("F_c_minus") == (-np.inf, np.inf)
    assert "F_c_minus" in result.uncertainty.combinations[0]
    assert result.derived["F_c"].std == np.inf and result.derived["F_offset"].std == np.inf
    for name in ("M", "f_v", "F_c_plus"):
        apart = result.parameters[name].value - made.FORCE_TRUE[name]
        assert 0 < result.std(name) < np.inf and abs(apart) < 4 * result.std(name)
    assert np.isfinite(result.uncertainty.correlation).all()


def test_a_record_at_rest_says_nothing(made, force):
    axis = force[0].with_parameters({"F_c_plus": 14.0, "F_c_minus": 14.0})
    record = made.recorded(axis, np.zeros((500, 1)), np.zeros((2, 500)), 0)
    result = fit_output_error(axis, [record], None, options(made))
    said = result.uncertainty
    # Nothing holds f_v, so rounding may end at its bound: "at bound" has no interval either.
    assert {"f_v", "F_c_plus", "F_c_minus"} <= {*said.uninformed, *said.at_bound}
    assert {"F_c_plus", "F_c_minus"} <= set(said.uninformed)
    # The noise on the first velocity may tell of the mass, but no more than nothing.
    assert result.std("M") > result.parameters["M"].value


def test_two_parameters_that_do_the_same_are_told_as_one_combination(made, force):
    from pneumo_casadi.model.effect import Effect
    from pneumo_casadi.parameters import Parameter

    class Twin(Effect):
        name = "twin"
        parameters = (Parameter("f_v", 0.0, "N s/m", scale=10.0, null=0.0),)

        def force(self, F, at):
            return F - at["f_v"] * at.v

    axis, u, x = force
    record = made.recorded(axis, u, x, 0)
    result = fit_output_error(axis.with_effects(Twin()), [record], None, options(made))
    assert set(result.uncertainty.uninformed) == {"f_v", "twin.f_v"}
    (combination,) = result.uncertainty.combinations
    assert "f_v" in combination and "twin.f_v" in combination
    total = result.parameters["f_v"].value + result.parameters["twin.f_v"].value
    assert total == pytest.approx(made.FORCE_TRUE["f_v"], rel=1e-3)
    assert 0 < result.std("M") < np.inf


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_a_hopeless_fit_raises_with_the_partial_result(made, force, method):
    axis, u, x = force
    record = made.recorded(axis, u[:600], x[:, :600], 0)
    begin = made.perturbed(axis, {"M": 2.0, "f_v": 3.0})
    with pytest.raises(FitError, match="iterations") as caught:
        fit_output_error(begin, [record], None, options(made, method=method, max_iterations=1))
    partial = caught.value.partial
    assert partial.status != "converged"
    assert partial.stages and all(stage.cost >= 0 for stage in partial.stages)
    assert {s.status for s in partial.stages} != {"converged"}
    assert set(partial.uncertainty.names) == {"M", "f_v", "F_c_plus", "F_c_minus"}


@pytest.mark.slow
def test_who_wants_no_recovery_gets_the_stages_asked_for_and_no_others(made, force):
    axis, u, x = force
    begin = made.perturbed(axis, {"M": 2.0, "f_v": 3.0})
    record = made.recorded(axis, u[:600], x[:, :600], 0)
    asked = {"max_iterations": 1}
    for recover, told in ((True, "also by way of short windows"), (False, r"iterations\. ")):
        with pytest.raises(FitError, match=told) as caught:
            fit_output_error(begin, [record], None, options(made, **asked, recover=recover))
        assert len(caught.value.partial.stages) == (4 if recover else 1)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_a_model_that_runs_away_is_a_failed_fit_and_no_numerical_accident(made, servo, method):
    """Beyond the end of the stroke the volume is negative and pressures explode."""
    axis, u, _ = servo
    p = axis.parameters
    axis = made.free_only(axis, "M", "f_v")
    rng = np.random.default_rng(0)
    t = np.arange(60) / made.FS
    channels = {
        "p_P": 5e5 + 2e5 * rng.standard_normal(60),
        "p_N": 5e5 + 2e5 * rng.standard_normal(60),
        "x": 0.4 * np.sin(400 * t),
        "u_P": u[:60, 0],
        "u_N": u[:60, 1],
    }
    record = Recording(t, channels, "nonsense", "made", made.InputHold.ZERO)
    assert p["X_s4"].value / p["X_s5"].value < 0.4
    # By way of short windows once: they are the same for each method.
    chosen = options(made, method=method, recover=method is Method.GAUSS_NEWTON)
    try:
        result = fit_output_error(axis, [record], None, chosen)
    except FitError as error:
        assert error.partial is not None
    else:
        assert result.sigma[2] > 0.05  # a fit, but one that owns up to its misfit


@pytest.mark.slow
def test_the_pull_on_the_map_counts_from_the_map_s_own_fit(made, servo, start, fitted):
    """Also when stages come before: each starts where the last one ended."""
    axis, u, x = servo
    table, begin = start(0)
    record = made.recorded(axis, u, x, 0)
    stages = options(made, widths=(5e-2, made.TRUE["v_s"]))
    result = fit_output_error(begin, [record], table, stages)
    assert len(result.stages) >= 2

    def rms(parameters):
        c = [parameters[n].value for n in begin.flow.parameters.names]
        return np.sqrt(np.mean(begin.flow.with_theta(c).residuals(table) ** 2))

    wanted = rms(result.parameters) / rms(begin.parameters)
    assert wanted > 1
    assert result.flow_map_deviation.rms == pytest.approx(wanted, rel=1e-9)
    assert result.flow_map_deviation.rms == pytest.approx(fitted.flow_map_deviation.rms, rel=1e-3)
    assert result.flow_map_deviation.scale == pytest.approx(1.0, abs=2e-3)


def test_a_map_of_another_scale_pulls_the_chambers_along(made, servo, start):
    """The anchor decides the scale: a meter that reads 3 % high makes X_s 3 % high."""
    axis, u, x = servo
    record = made.recorded(axis, u, x, 0)
    table, _ = start(0)
    high = made.FlowMap(table.u, table.p, 1.03 * table.q_m, table.p_supply, table.p_ext)
    flow = made.fit_polynomials(high, (3, 3, 3))
    begin = made.Servosystem(made.BENCH, flow).with_parameters(made.TRUE)
    result = fit_output_error(begin, [record], high, options(made))
    for name in ("X_s1", "X_s3", "X_s6"):
        assert result.parameters[name].value / made.TRUE[name] == pytest.approx(1.03, abs=3e-3)
    assert result.parameters["M"].value == pytest.approx(made.TRUE["M"], rel=1e-3)
    k_P = made.TRUE["X_s3"] / made.TRUE["X_s2"]
    assert result.derived["k_P"].value == pytest.approx(k_P, abs=0.01)


def test_progress_is_told_and_every_stage_is_on_record(made, start, short):
    table, begin = start(0)
    told = []
    result = fit_output_error(
        begin,
        [short],
        table,
        options(made, widths=(2e-2, 5e-3)),
        lambda text, share: told.append((text, share)),
    )
    assert told[-1] == ("done", 1.0) and all(0 <= share <= 1 for _, share in told)
    assert [s for _, s in told] == sorted(s for _, s in told)
    assert {stage.v_s for stage in result.stages} == {2e-2, 5e-3}
    assert result.iterations == sum(stage.iterations for stage in result.stages)
    assert all(stage.seconds >= 0 and stage.cost > 0 for stage in result.stages)
    # Stages are costed with the stated noise, the result with the estimated one.
    assert result.stages[-1].cost != result.cost
    assert result.stages[-1].cost == pytest.approx(result.cost, rel=0.05)


def test_samples_beyond_the_last_whole_block_are_left_out_and_no_others(made, start, short):
    table, begin = start(0)
    problem = write_problem(begin, [short], table, options(made, block=7e-3, window=0.1))
    used = [(s.first, s.first + s.K * s.n) for s in problem.segments]
    assert used[0][0] == 0 and all(a[1] == b[0] for a, b in pairwise(used))
    assert short.N - 1 - 7 < used[-1][1] <= short.N - 1
    for segment in problem.segments:
        rows = slice(segment.first, segment.first + segment.K * segment.n)
        np.testing.assert_array_equal(segment.w, short.stack(begin.inputs)[rows].T)
        mean = short["x"][rows].reshape(segment.K, segment.n).mean(axis=1)
        np.testing.assert_allclose(segment.y[2], mean, rtol=1e-12)


def test_a_standard_deviation_goes_by_every_name_and_by_no_other(fitted):
    assert fitted.std("k_P") == fitted.derived["k_P"].std
    assert fitted.std("k_P", robust=True) == fitted.derived["k_P"].std_robust
    assert fitted.std("v_s") == 0.0
    with pytest.raises(ModelError, match="nonsense"):
        fitted.std("nonsense")


def test_fewer_data_than_unknowns_are_refused(made, start, short):
    table, begin = start(0)
    with pytest.raises(ModelError, match="longer windows"):
        write_problem(begin, [short], table, options(made, window=2e-3))


def test_records_under_different_hold_are_refused_in_words(made, start, short):
    table, begin = start(0)
    channels = {name: short[name] for name in short.names}
    other = Recording(short.t, channels, "other", "made", InputHold.LINEAR)
    with pytest.raises(ModelError, match="input hold"):
        fit_output_error(begin, [short, other], table, options(made))


def test_a_meter_that_is_off_within_its_accuracy_is_no_moved_map(start):
    table, axis = start(0)
    moved = {n: 1.02 * axis.parameters[n].value for n in axis.flow_parameters}
    for accuracy, expected in ((None, False), (0.02, True)):
        valve = ValveData(accuracy=accuracy)
        bench = replace(axis.bench, valves=Valves(valve, valve))
        own = replace(axis, bench=bench)
        deviation = flow_map_deviation(anchor_flow(own, table), own.with_parameters(moved))
        assert deviation.scale == pytest.approx(1.02, abs=2e-3)
        assert (deviation.rms < 1.05) is expected
