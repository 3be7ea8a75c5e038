"""Estimates move with the flow map as theory says, whichever way it is used."""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from pneumo_casadi.data import ValveData, Valves
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.estimation.wls import fit_wls
from pneumo_casadi.model.servosystem import Servosystem
from pneumo_casadi.sensitivity import (
    MeteringErrors,
    Treatment,
    Variant,
    flow_sensitivity,
    map_sensitivity,
)
from pneumo_casadi.valve import fit_polynomials, fit_spline

CHAMBERS = tuple(f"X_s{i}" for i in range(1, 7))
LIKE_THE_TRUTH = partial(fit_polynomials, degrees=(3, 3, 3))
TOO_HIGH = partial(fit_polynomials, degrees=(20, 20, 20))
GAIN, FILLING = MeteringErrors(gain=0.02), MeteringErrors(gain_filling=1e-3)


@pytest.fixture(scope="module")
def options(made):
    return OutputErrorOptions(widths=(made.TRUE["v_s"],), reweight=False)


@pytest.fixture(scope="module")
def record(made):
    axis = made.true_axis()
    return made.recorded(axis, *made.controlled(axis, 2000))


@pytest.fixture(scope="module")
def table(made):
    return made.measured_map(0)


@pytest.fixture(scope="module")
def study(made, record, table, options):
    forms = {"3-3-3": LIKE_THE_TRUTH, "20-20-20": TOO_HIGH}
    return flow_sensitivity(
        made.BENCH,
        [record],
        table,
        forms,
        (MeteringErrors(), GAIN, FILLING),
        held_out=[record],
        options=options,
    )


@pytest.fixture(scope="module")
def anchored(made, record, table, options):
    axis = Servosystem(made.BENCH, LIKE_THE_TRUTH(table))
    start = axis.started_at(fit_wls(axis, [record]).parameters)
    return fit_output_error(start, [record], table, options)


def relative_shift(row, reference, estimator="output_error"):
    result, plain = getattr(row, estimator), getattr(reference, estimator)
    return {name: result[name].value / plain[name].value - 1 for name in plain}


@pytest.mark.slow
@pytest.mark.parametrize("treatment", [Treatment.FIXED, Treatment.ANCHORED])
def test_a_gain_error_of_the_map_moves_all_X_s_by_itself_and_nothing_else(study, treatment):
    with_gain, plain = (study.row("3-3-3", treatment, m) for m in (GAIN, MeteringErrors()))
    shift = relative_shift(with_gain, plain)
    for name, moved in shift.items():
        expected = GAIN.gain if name in CHAMBERS else 0.0
        assert moved == pytest.approx(expected, abs=2e-5), name
    assert with_gain.held_out == pytest.approx(plain.held_out, rel=1e-4)


@pytest.mark.slow
def test_weighted_least_squares_answers_a_gain_error_in_the_same_way(study):
    rows = [study.row("3-3-3", Treatment.FIXED, m) for m in (GAIN, MeteringErrors())]
    shift = relative_shift(*rows, "wls")
    for name, moved in shift.items():
        assert moved == pytest.approx(GAIN.gain if name in CHAMBERS else 0.0, abs=1e-8), name


@pytest.mark.slow
def test_without_the_map_trajectories_give_all_ratios(study, made):
    row = study.row("3-3-3", Treatment.LEFT_OUT)
    S_rT = made.BENCH.S_P / (made.BENCH.r * made.BENCH.T)
    assert row.output_error["X_s3"].value == pytest.approx(S_rT, rel=1e-12)
    assert row.output_error["X_s3"].std == 0.0
    true = {name: made.TRUE[name] * S_rT / made.TRUE["X_s3"] for name in CHAMBERS}
    true |= {"M": made.TRUE["M"], "k_P": made.TRUE["X_s3"] / made.TRUE["X_s2"]}
    for name, value in true.items():
        change = row.output_error[name]
        assert abs(change.value - value) <= 4 * change.std + 1e-9 * value, name
        assert change.std < 0.05 * value, name


@pytest.mark.slow
def test_a_map_left_out_moves_nothing(study):
    rows = [study.row("3-3-3", Treatment.LEFT_OUT, m) for m in (FILLING, MeteringErrors())]
    assert max(map(abs, relative_shift(*rows).values())) < 1e-4


@pytest.mark.slow
def test_rows_keep_their_order_and_failures_their_place(study):
    assert [row.variant for row in study.rows] == [
        Variant(form, metering, treatment)
        for form in ("3-3-3", "20-20-20")
        for metering in (MeteringErrors(), GAIN, FILLING)
        for treatment in Treatment
    ]
    assert all(row.converged for row in study.rows[:9])
    for row in study.rows[9:]:
        assert not row.converged
        assert "distinct pressures" in row.status
        assert not row.wls and not row.output_error
    frame = study.frame()
    assert len(frame) == len(study.rows)
    assert frame["output_error.k_P"].notna().sum() == 9


@pytest.mark.slow
def test_a_fit_that_fails_keeps_its_row_and_its_weighted_least_squares(
    made, record, table, options
):
    short = replace(options, max_iterations=1, recover=False)
    (row,) = flow_sensitivity(
        made.BENCH, [record], table, {"3-3-3": LIKE_THE_TRUTH}, treatments=[Treatment.FIXED],
        options=short,
    ).rows  # fmt: skip
    assert "output error" in row.status
    assert not row.output_error
    assert row.wls["M"].value == pytest.approx(made.TRUE["M"], rel=0.05)


@pytest.mark.slow
def test_other_processes_find_the_same(study, made, record, table, options):
    with ProcessPoolExecutor(1) as executor:
        other = flow_sensitivity(
            made.BENCH, [record], table, {"3-3-3": LIKE_THE_TRUTH}, [GAIN],
            [Treatment.FIXED], options=options, executor=executor,
        )  # fmt: skip
    (row,) = other.rows
    same = study.row("3-3-3", Treatment.FIXED, GAIN)
    assert row.variant == same.variant
    assert row.output_error == same.output_error


@pytest.mark.slow
@pytest.mark.parametrize("treatment", [Treatment.FIXED, Treatment.ANCHORED])
@pytest.mark.parametrize("metering", [GAIN, FILLING])
def test_first_order_tells_what_refitting_finds(study, anchored, table, treatment, metering):
    shift = map_sensitivity(anchored, table).shift(metering.flow_error(table), treatment)
    moved, plain = (study.row("3-3-3", treatment, m) for m in (metering, MeteringErrors()))
    size = max(metering.gain, metering.gain_filling)
    for name in (*CHAMBERS, "k_P", "k_N", "M"):
        before = plain.output_error[name].value
        refitted = moved.output_error[name].value / before - 1
        assert shift[name] / before == pytest.approx(refitted, rel=0.1, abs=0.1 * size), name


@pytest.mark.slow
def test_a_gain_error_moves_X_s_by_itself_where_the_meter_s_accuracy_is_stated(
    made, record, table, options
):
    """The factor of the meter is free then, and takes up what all points have in common."""
    valve = ValveData(accuracy=0.02)
    bench = replace(made.BENCH, valves=Valves(valve, valve))
    axis = Servosystem(bench, LIKE_THE_TRUTH(table))
    start = axis.started_at(fit_wls(axis, [record]).parameters)
    fit = fit_output_error(start, [record], table, options)
    shift = map_sensitivity(fit, table).shift(GAIN.flow_error(table), Treatment.ANCHORED)
    for name in CHAMBERS:
        assert shift[name] / fit.parameters[name].value == pytest.approx(GAIN.gain, rel=0.05), name


def test_the_answer_to_coefficients_and_to_flows_is_the_same(anchored, table):
    sensitivity = map_sensitivity(anchored, table)
    flow = anchored.axis.flow
    doubled = {name: flow.parameters[name].value for name in sensitivity.coefficients}
    by_coefficients = sensitivity.shift_of_coefficients(doubled)
    by_flows = sensitivity.shift(flow(table.u, table.p), Treatment.FIXED)
    assert by_flows == pytest.approx(by_coefficients, rel=1e-6)
    # The whole map scaled by one factor is the gauge: X_s follow, ratios stay.
    for name in CHAMBERS:
        X_s = anchored.parameters[name].value
        assert by_flows[name] == pytest.approx(X_s, rel=0.05)


def test_spread_from_noise_is_that_of_drawn_maps(anchored, table):
    sensitivity = map_sensitivity(anchored, table)
    noise = 1e-3 * table.q_max
    drawn = [
        sensitivity.shift(
            MeteringErrors(noise=1e-3, seed=seed).flow_error(table), Treatment.ANCHORED
        )
        for seed in range(400)
    ]
    std = sensitivity.std(noise, Treatment.ANCHORED)
    for name in (*CHAMBERS, "k_P", "k_N"):
        assert np.std([figure[name] for figure in drawn]) == pytest.approx(std[name], rel=0.15), (
            name
        )


def test_sensitivity_needs_free_coefficients_and_every_point(anchored, table):
    sensitivity = map_sensitivity(anchored, table)
    with pytest.raises(ModelError, match="metered points"):
        sensitivity.shift([1e-5], Treatment.FIXED)
    with pytest.raises(ModelError, match="left out moves no estimate"):
        sensitivity.std(1e-5, Treatment.LEFT_OUT)
    with pytest.raises(ModelError, match="no free coefficient phi_9"):
        sensitivity.shift_of_coefficients({"phi_9": 1.0})
    flow = anchored.axis.flow.parameters.names
    kept = [i for i, name in enumerate(anchored.uncertainty.names) if name not in flow]
    names = tuple(anchored.uncertainty.names[i] for i in kept)
    covariance = anchored.uncertainty.covariance[np.ix_(kept, kept)]
    held = replace(
        anchored, uncertainty=replace(anchored.uncertainty, names=names, covariance=covariance)
    )
    with pytest.raises(ModelError, match="no coefficient was free"):
        map_sensitivity(held, table)


def test_a_metering_that_cannot_be_is_refused():
    for wrong in ({"gain": -1.0}, {"gain_exhaust": -2.0}, {"noise": -1e-3}):
        with pytest.raises(ModelError, match="gain errors are shares"):
            MeteringErrors(**wrong)


def test_a_pressure_offset_moves_the_points_and_not_their_flows(table):
    moved = MeteringErrors(pressure_offset=500.0).of(table)
    assert np.array_equal(moved.p, table.p + 500.0)
    assert np.array_equal(moved.q_m, table.q_m)


def test_a_study_of_nothing_is_refused(made, record, table):
    with pytest.raises(ModelError, match="nothing to compare"):
        flow_sensitivity(made.BENCH, [record], table, {})


@pytest.mark.slow
def test_one_gain_has_no_shape_to_free(made, record, table, options):
    short = record.window(0.0, 1.0)
    fixed, left_out = flow_sensitivity(
        made.BENCH, [short], table, {"spline": partial(fit_spline, segments_p=6)},
        treatments=[Treatment.FIXED, Treatment.LEFT_OUT], options=options,
    ).rows  # fmt: skip
    assert fixed.converged, fixed.status
    k = fixed.output_error["k_P"]
    assert left_out.output_error["k_P"].value == pytest.approx(k.value, rel=1e-9)
