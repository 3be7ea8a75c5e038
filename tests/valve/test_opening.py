"""Openings that follow a curve: the fit of notched ports, and that every curve rises."""

from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneumo_casadi.estimation.flow_anchor import anchor_to_flow_map
from pneumo_casadi.valve import (
    FlowForm,
    Reason,
    choose_flow_form,
    fit_iso6358,
    fit_iso6358_curve,
)
from pneumo_casadi.valve.opening import (
    KNOTS,
    LIKE_HYPERBOLA,
    conductance,
    curve_parameters,
)

REACH = 5.0
HYPERBOLA = {
    "k_supply": 3e-9,
    "u_0_supply": 0.1,
    "w_supply": 0.05,
    "h_supply": 0.2,
    "C_leak_supply": 1e-11,
    "b_supply": 0.3,
}


def curve(values=None):
    """The conductance over the command of one edge with these parameters, and their names."""
    start = curve_parameters(HYPERBOLA, "supply", REACH)
    values = {item.name: item.value for item in start} | (values or {})
    u = ca.SX.sym("u")
    C = conductance(values, "supply", u, REACH)
    function = ca.Function("C", [u], [C])
    return lambda u: function(np.asarray(u, dtype=float).reshape(1, -1)).full().ravel()


def test_a_notched_edge_near_null_is_met_four_times_closer_than_by_a_hyperbola(notched_valve):
    noise = 2e-5
    table, exact = notched_valve(noise), notched_valve(n_u=201)
    used = np.abs(exact.u) < 1

    def error(flow):
        return np.sqrt(np.mean(flow.residuals(exact)[used] ** 2))

    hyperbola, fitted = fit_iso6358(table), fit_iso6358_curve(table)
    assert error(fitted) < error(hyperbola) / 4
    assert error(fitted) < noise / 2
    assert fitted.sigma == pytest.approx(noise, rel=0.1)
    assert hyperbola.sigma > 1.3 * noise


@pytest.mark.slow
def test_the_curve_is_chosen_where_ports_are_notched(notched_valve):
    selection = choose_flow_form(notched_valve(2e-5))
    assert selection.chosen is FlowForm.ISO6358_CURVE
    assert selection.reason is Reason.LEAST_ERROR


def test_a_straight_edge_needs_no_curve(spool_valve):
    table = spool_valve(noise=1e-5, n_u=41)
    straight, fitted = fit_iso6358(table), fit_iso6358_curve(table)
    assert fitted.sigma == pytest.approx(straight.sigma, rel=0.02)
    slopes = [fitted.parameters[f"k_{j}_exhaust"].value for j in range(2, len(KNOTS) + 1)]
    np.testing.assert_allclose(slopes, 4e-9, rtol=0.02)


def test_it_begins_at_the_slopes_of_the_hyperbola():
    law = curve({"w_supply": 1e-9, "u_0_supply": 0.0})
    at = np.array(KNOTS[1:]) * REACH
    slope = (law(at + 1e-4) - law(at - 1e-4)) / 2e-4
    np.testing.assert_allclose(slope, 3e-9 / (1 + 0.2 * at) ** 2, rtol=1e-3)


@given(
    st.lists(st.floats(0, 1e-8), min_size=len(KNOTS), max_size=len(KNOTS)),
    st.floats(-5, 5),
    st.floats(5e-4, 5),
)
def test_whatever_the_slopes_the_conductance_rises(slopes, u_0, w):
    gains = {f"k_{j}_supply": k for j, k in enumerate(slopes, 1)}
    C = curve(gains | {"u_0_supply": u_0, "w_supply": w})(np.linspace(-8, 8, 801))
    assert np.all(C >= 1e-11 * (1 - 1e-12))
    assert all(b >= a - 1e-12 * C.max() for a, b in pairwise(C))


@pytest.mark.parametrize("stated", [0.992, 1.0, 1.005])
def test_a_supply_that_was_stated_wrong_is_told_by_the_map(spool_valve, stated):
    table = spool_valve(noise=1e-5, n_u=21)
    fitted = fit_iso6358_curve(replace(table, p_supply=stated * 7e5))
    ratio = fitted.parameters["supply_ratio"].value
    sigma = np.sqrt(np.diag(fitted.covariance)[fitted.parameters.index("supply_ratio")])
    assert ratio == pytest.approx(1 / stated, abs=max(4 * sigma, 2e-4))
    assert sigma < 5e-4
    assert fitted.sigma == pytest.approx(1e-5, rel=0.1)


def test_scale_is_that_of_all_conductances_together(notched_valve):
    table = notched_valve(2e-5)
    flow = fit_iso6358_curve(table)
    assert flow.scale_sigma == pytest.approx(fit_iso6358(table).scale_sigma, rel=0.7)
    assert 0 < flow.scale_sigma < 1e-3


def test_a_slope_that_no_command_tells_stands_near_the_hyperbolas(notched_valve):
    """Without commands just beyond null the gain there and the opening point cannot be told."""
    table = notched_valve(2e-5, n_u=21)
    few = table.select(np.abs(np.abs(table.u) - 0.5) > 0.1)
    hyperbola, fitted = fit_iso6358(few), fit_iso6358_curve(few)
    begin = fitted.parameters["k_1_exhaust"].value / hyperbola.parameters["k_exhaust"].value
    assert 0.3 < begin < 2
    left_out = fitted.residuals(table)[np.abs(np.abs(table.u) - 0.5) < 0.1]
    assert np.sqrt(np.mean(left_out**2)) < 0.02 * table.q_max


def test_what_is_known_beside_a_coarse_map_stays_known_where_records_are_fitted(notched_valve):
    """Eleven commands do not tell the first slopes of either edge."""
    table = notched_valve(2e-5, n_u=11, n_p=7)
    flow = fit_iso6358_curve(table)
    J = anchor_to_flow_map(table, flow).jacobian(flow.parameters.values) * flow.parameters.scales
    std = np.sqrt(np.diag(np.linalg.pinv(J.T @ J)))
    told = dict(zip(flow.parameters.names, std, strict=True))
    slopes = [told[f"k_{j}_{side}"] for j in range(1, 6) for side in ("supply", "exhaust")]
    assert max(slopes) <= LIKE_HYPERBOLA * 1.001
    assert told["supply_ratio"] <= 1.001
    assert max(slopes) > 0.5 * LIKE_HYPERBOLA


def test_edges_metered_to_different_commands_have_their_own_openings(notched_valve):
    table = notched_valve(2e-5)
    part = table.select(table.u < 2.6)
    fitted = fit_iso6358_curve(part)
    assert fitted.sigma == pytest.approx(2e-5, rel=0.15)
    assert np.abs(fitted.residuals(part)).max() < 0.02 * part.q_max
