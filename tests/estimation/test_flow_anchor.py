"""What fixes the scale of the flows: metered map, stated accuracy, areas and data sheet."""

from dataclasses import replace

import numpy as np
import pytest

import pneumo_casadi as pc
from pneumo_casadi.data import FlowSource, ValveData, Valves
from pneumo_casadi.errors import CaseError
from pneumo_casadi.estimation.flow_anchor import (
    anchor_flow,
    anchor_to_flow_map,
    join_anchors,
    prior,
)
from pneumo_casadi.estimation.flow_scale import flow_scale_covariance, flow_scale_std
from pneumo_casadi.model.servosystem import Servosystem
from pneumo_casadi.valve import (
    FlowMapPair,
    FlowPair,
    fit_iso6358,
    fit_polynomials,
    iso6358_from_data_sheet,
    read_flow_map,
)

ACCURACY = 0.02


@pytest.fixture(scope="module")
def case():
    return pc.example_case()


@pytest.fixture(scope="module")
def metered(case):
    bench = case.bench
    table = read_flow_map(case.flow_map_path, p_supply=bench.p_supply, p_ext=bench.p_ext)
    return table, fit_iso6358(table, T=bench.T)


def scaled(anchor, factor):
    conductances = [name.startswith(("k_", "C_leak_")) for name in anchor.names]
    return np.where(conductances, factor, 1.0) * anchor.fitted


@pytest.mark.parametrize("factor", [0.7, 0.98, 1.1])
def test_a_common_factor_of_all_flows_costs_what_the_accuracy_of_the_meter_says(metered, factor):
    anchor = anchor_to_flow_map(*metered, accuracy=ACCURACY)
    residual = anchor(scaled(anchor, factor))
    assert residual[-1] == pytest.approx((1 / factor - 1) / ACCURACY, rel=1e-3)
    points = anchor(anchor.fitted)[:-1]
    assert np.sum(residual[:-1] ** 2) == pytest.approx(np.sum(points**2), rel=1e-2)
    assert (anchor.n_points, anchor.n_prior) == (metered[0].u.size, 1)


def test_the_derivatives_with_a_free_scale_are_those_of_the_residuals(metered):
    anchor = anchor_to_flow_map(*metered, accuracy=ACCURACY)
    c = scaled(anchor, 1.05)
    J = anchor.jacobian(c)
    for i in np.flatnonzero(np.abs(J).max(axis=0) > 0):
        h = np.zeros(c.size)
        h[i] = 1e-5 * metered[1].parameters.scales[i]
        slope = (anchor(c + h) - anchor(c - h)) / (2 * h[i])
        assert slope == pytest.approx(J[:, i], abs=1e-4 * np.abs(J[:, i]).max())


def test_without_a_stated_accuracy_the_map_counts_as_before(metered, case):
    axis = Servosystem(case.bench, metered[1])
    anchor = anchor_flow(axis, metered[0])
    assert anchor.n_prior == 0
    assert anchor(anchor.fitted) == pytest.approx(
        -metered[1].residuals(metered[0]) / metered[1].sigma
    )
    assert flow_scale_std(axis) == {"P": 0.0, "N": 0.0}


def test_each_point_is_anchored_at_its_own_supply_pressure(metered):
    table, flow = metered
    supply = np.where(np.arange(table.n) % 2, 6e5, flow.p_supply)
    keep = table.p <= 5e5
    lower = replace(table, q_m=flow(table.u, table.p, supply), p_supply=flow.p_supply)
    lower = replace(lower.select(keep), p_supply=supply[keep])
    anchor = anchor_to_flow_map(lower, flow)
    assert anchor(anchor.fitted) == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(CaseError, match="this model holds at one supply pressure"):
        anchor_to_flow_map(lower, fit_polynomials(table))


def test_an_unmetered_valve_is_anchored_by_the_areas(case):
    valve = ValveData(FlowSource.DATA_SHEET, None, 2e-8, 1.5e-8, 0.3, u_full=5.0)
    bench = replace(case.bench, valves=Valves(valve, valve), area_accuracy=0.005)
    axis = Servosystem(bench, iso6358_from_data_sheet(bench, valve))
    anchor = anchor_flow(axis, None)
    assert anchor.n_points == 0
    at_start = anchor(anchor.fitted)
    assert at_start == pytest.approx(0.0, abs=1e-9)
    moved = anchor.fitted.copy()
    moved[anchor.names.index("X_s3")] *= 1.01
    moved[anchor.names.index("k_supply")] *= 1.3
    changes = dict(zip(anchor.names, anchor(moved), strict=True))
    assert changes["X_s3"] == pytest.approx(2.0)  # 1 % over 0.5 %
    assert changes["k_supply"] == pytest.approx(1.0)  # 30 % of a data sheet without accuracy
    assert flow_scale_std(axis) == pytest.approx({"P": 0.005 / 2**0.5, "N": 0.005 / 2**0.5})


def test_two_meters_widen_the_estimates_of_their_own_chamber(case, metered):
    meters = Valves(ValveData(accuracy=0.01), ValveData(accuracy=0.02))
    bench = replace(case.bench, valves=meters)
    axes = [Servosystem(b, FlowPair(metered[1], metered[1])) for b in (case.bench, bench)]
    assert flow_scale_std(axes[1]) == {"P": 0.01, "N": 0.02}
    records = [case.identify[0].window(5.0, 9.0)]
    plain, wider = (pc.fit_wls(axis, records) for axis in axes)
    added = np.diag(wider.fit.covariance - plain.fit.covariance)
    share = dict(zip(plain.fit.names, np.sqrt(added) / np.abs(plain.fit.estimate), strict=True))
    expected = {f"X_s{i}": 0.01 if i <= 3 else 0.02 for i in range(1, 7)}
    assert share == pytest.approx({name: expected.get(name, 0.0) for name in share}, abs=1e-9)


def test_one_map_of_two_stated_accuracies_has_the_worse_one(case, metered):
    bench = replace(case.bench, valves=Valves(ValveData(accuracy=0.01), ValveData(accuracy=0.02)))
    axis = Servosystem(bench, metered[1])
    assert flow_scale_std(axis) == {"P": 0.02, "N": 0.02}
    anchor = anchor_flow(axis, metered[0])
    alone = anchor_to_flow_map(*metered, accuracy=0.02)
    c = scaled(alone, 1.05)
    assert anchor(c) == pytest.approx(alone(c))


def test_sources_are_joined_with_measured_points_first(metered):
    known = prior(("M",), np.array([17.0]), np.array([0.5]))
    points = anchor_to_flow_map(*metered)
    joined = join_anchors([known, points])
    assert joined.names == ("M", *points.names)
    assert (joined.n_points, joined.n_prior) == (points.n, 1)
    c = np.concatenate([[18.0], points.fitted])
    assert joined(c)[-1] == pytest.approx(2.0)
    assert joined(c)[:-1] == pytest.approx(points(points.fitted))


def test_an_unknown_factor_of_the_flows_moves_the_parameters_of_its_chamber_together(case, metered):
    names, values = ("X_s1", "X_s3", "X_s6", "M"), np.array([3.0, 10.0, 7.0, 17.0])
    flow = metered[1]
    equal = replace(case.bench, valves=Valves(ValveData(accuracy=0.01), ValveData(accuracy=0.01)))
    two_maps = Servosystem(equal, FlowPair(flow, flow))
    added = flow_scale_covariance(names, values, two_maps)
    P, N = 0.01 * np.array([3.0, 10.0, 0.0, 0.0]), 0.01 * np.array([0.0, 0.0, 7.0, 0.0])
    assert added == pytest.approx(np.outer(P, P) + np.outer(N, N))
    assert anchor_flow(two_maps, FlowMapPair(metered[0], metered[0])).n_prior == 2
    one_map = Servosystem(equal, flow)
    both = 0.01 * np.array([3.0, 10.0, 7.0, 0.0])
    assert flow_scale_covariance(names, values, one_map) == pytest.approx(np.outer(both, both))
    assert anchor_flow(one_map, metered[0]).n_prior == 1
    assert not flow_scale_covariance(names, values, Servosystem(case.bench, flow)).any()
