"""Where records bend the form of the flow map, its scale at their flows counts as biased."""

import numpy as np
import pytest

from pneumo_casadi.estimation.output_error import (
    OutputErrorOptions,
    fit_output_error,
    information,
)
from pneumo_casadi.estimation.output_error.flow_scale_shift import _beyond, flow_scale_shift
from pneumo_casadi.estimation.output_error.stages import write_problem
from pneumo_casadi.valve import FlowMapPair, FlowPair, fit_polynomials

P, N = [f"X_s{i}" for i in (1, 2, 3)], [f"X_s{i}" for i in (4, 5, 6)]


@pytest.fixture(scope="module")
def record(made, servo):
    axis, u, x = servo
    return made.recorded(axis, u[:400], x[:, :400], 0)


@pytest.fixture(scope="module")
def relative_shift(made, record):
    """Return the shift of named parameters over their values, for changed coefficients."""

    def of(axis, table, changes):
        options = OutputErrorOptions(widths=(made.TRUE["v_s"],))
        problem = write_problem(axis, [record], table, options)
        fitted = problem.parameters
        values = {name: factor * fitted[name].value for name, factor in changes.items()}
        fitted = fitted.with_values(values)
        shift = flow_scale_shift(problem, fitted.values, [record]) * problem.free_scales
        return dict(zip(problem.free, shift / fitted.select(problem.free).values, strict=True))

    return of


def test_flows_one_per_cent_above_the_map_shift_all_that_is_proportional_to_them(
    start, relative_shift
):
    table, axis = start()
    coefficients = axis.flow.parameters.names
    share = relative_shift(axis, table, dict.fromkeys(coefficients, 1.01))
    for name in (*P, *N, *coefficients):
        assert 0.98 * 0.01 < share[name] < 0.01  # less what noise makes
    assert share["M"] == share["f_v"] == share["F_c_plus"] == 0.0


def test_a_bent_form_counts_by_the_flows_that_the_record_uses(start, record, relative_shift):
    table, axis = start()
    changes = {"psi_plus_0": 1.05, "phi_1": 0.9}
    share = relative_shift(axis, table, changes)
    model = axis.flow
    bent = model.with_theta([item.value * changes.get(item.name, 1.0) for item in model.parameters])
    flows, expected = (
        np.concatenate([flow(record[f"u_{v}"], record[f"p_{v}"]) for v in "PN"])
        for flow in (bent, model)
    )
    difference = flows @ expected / (expected @ expected) - 1
    assert abs(difference) > 1e-3  # otherwise nothing is compared
    assert abs(share["X_s3"]) < abs(difference)
    assert share["X_s3"] == pytest.approx(difference, rel=0.05)


def test_the_valve_of_each_chamber_has_a_shift_of_its_own(made, start, relative_shift):
    table, axis = start()
    pair = made.Servosystem(made.BENCH, FlowPair(axis.flow, axis.flow)).with_parameters(made.TRUE)
    changes = {f"{name}_N": 1.02 for name in axis.flow.parameters.names}
    share = relative_shift(pair, FlowMapPair(table, table), changes)
    assert [share[name] for name in P] == pytest.approx([0.0] * 3, abs=1e-6)
    assert [share[name] for name in N] == pytest.approx([0.02] * 3, rel=0.02)
    assert share["psi_plus_0_P"] == pytest.approx(0.0, abs=1e-6)
    assert share["psi_plus_0_N"] == pytest.approx(0.02, rel=0.02)


@pytest.mark.slow
def test_what_the_noise_of_the_map_makes_is_no_bias(made, relative_shift, monkeypatch):
    """At the true coefficients: two thirds of the differences lie within their deviation."""
    true, known, shares = made.true_flow(), [], []

    def kept(difference, variance):
        known.append((difference, variance))
        return _beyond(difference, variance)

    monkeypatch.setattr(f"{flow_scale_shift.__module__}._beyond", kept)
    for k in range(20):
        table = made.measured_map(k)
        flow = fit_polynomials(table, (3, 3, 3))
        values = zip(flow.parameters, true.parameters, strict=True)
        changes = {own.name: exact.value / own.value for own, exact in values}
        shares.append(relative_shift(made.true_axis(flow=flow), table, changes)["X_s1"])
    difference, variance = np.array(known).T
    assert np.mean(difference**2 / variance) == pytest.approx(1.0, abs=0.5)
    assert np.mean(np.array(shares) == 0) > 0.5


@pytest.mark.parametrize(("variance", "expected"), [(0.0, -0.05), (9e-4, -0.04), (0.01, 0.0)])
def test_a_difference_counts_beyond_its_noise(variance, expected):
    assert _beyond(-0.05, variance) == pytest.approx(expected, abs=1e-15)


def test_a_held_parameter_of_a_chamber_gives_the_scale_and_nothing_shifts(start, relative_shift):
    table, axis = start()
    held = axis.with_parameters(axis.parameters.fix("X_s6"))
    changes = dict.fromkeys(axis.flow.parameters.names, 1.01)
    assert not any(relative_shift(held, table, changes).values())


@pytest.mark.slow
def test_the_robust_interval_contains_the_shift(made, start, record, monkeypatch):
    table, axis = start()
    options = OutputErrorOptions(widths=(made.TRUE["v_s"],))
    shift = {}

    def given(problem, theta, records):
        assert records == (record,)
        scaled = np.full(len(problem.free), 0.01)
        shift.update(zip(problem.free, scaled * problem.free_scales, strict=True))
        return scaled

    monkeypatch.setattr(information, "flow_scale_shift", given)
    known = fit_output_error(axis, [record], table, options).uncertainty
    added = np.diag(known.covariance_robust - known.covariance_scatter)
    for name in ("X_s3", "X_s6", "psi_plus_0"):
        # Beside the square of the bias by smoothing.
        assert added[known.names.index(name)] >= shift[name] ** 2 * (1 - 1e-9) > 0
