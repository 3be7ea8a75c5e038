"""Flow polynomials: eq. 12, its statistics, its derivatives and its continuation."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneumo_casadi.errors import CaseError, ModelError
from pneumo_casadi.valve import (
    FlowMap,
    edge_slopes,
    fit_iso6358,
    fit_polynomials,
    flow_function,
    map_residuals,
    select_degrees,
)

RNG = np.random.default_rng(1)
U_TRY = np.r_[RNG.uniform(-4, 4, 40), 0.0, 0.0, 2.0, -2.0]
P_TRY = np.r_[RNG.uniform(0.2e5, 9e5, 40), 1e5, 7e5, 1e5, 7e5]


def symbolic(flow, kind, theta=None):
    u, p = kind.sym("u"), kind.sym("p")
    t = kind.sym("theta", len(flow.parameters))
    q = flow.expression(u, p, t)
    function = ca.Function("q", [u, p, t], [q, ca.gradient(q, ca.vertcat(u, p)), ca.jacobian(q, t)])
    return lambda a, b: function(a, b, flow.parameters.values if theta is None else theta)


def test_a_map_that_is_a_polynomial_is_recovered_with_its_coefficients(spool_valve):
    truth = fit_polynomials(spool_valve())
    table = spool_valve()
    flow = fit_polynomials(FlowMap(table.u, table.p, truth(table.u, table.p)))
    error = (flow.parameters.values - truth.parameters.values) / truth.parameters.scales
    assert np.abs(error).max() < 1e-13
    assert flow.sigma < 1e-16
    assert flow.degrees == (7, 7, 4)
    assert flow.dof == table.n - 21


@pytest.mark.parametrize("fit", [fit_polynomials, fit_iso6358])
@pytest.mark.parametrize("size", [0, 1, 100])
def test_coefficients_of_another_number_are_refused(spool_valve, fit, size):
    """CasADi would take one for all of them, and none for zeros."""
    flow = fit(spool_valve())
    for ports in ((), (1.1, 0.9)):
        law = flow.expression_at if ports else flow.expression
        with pytest.raises(ModelError, match="expected"):
            law(ca.SX.sym("u"), ca.SX.sym("p"), ca.SX.sym("theta", size), *ports)


def test_degrees_and_range_may_be_lists(spool_valve):
    flow = fit_polynomials(spool_valve(), degrees=(3, 2, 1))
    lists = replace(flow, degrees=[3, 2, 1], p_range=np.array(flow.p_range))
    given = (ca.DM(1.0), ca.DM(3e5), ca.DM(flow.parameters.values))
    assert float(lists.expression(*given)) == float(flow.expression(*given))


@pytest.mark.slow
def test_intervals_cover_the_truth_at_their_level(spool_valve):
    truth = fit_polynomials(spool_valve())
    table = spool_valve()
    q_true, sigma = truth(table.u, table.p), 2e-5
    covered, scales = [], []
    for seed in range(100):
        q = q_true + sigma * np.random.default_rng(seed).standard_normal(table.n)
        flow = fit_polynomials(FlowMap(table.u, table.p, q))
        error = flow.parameters.values - truth.parameters.values
        covered.append(np.abs(error) < 1.96 * np.sqrt(np.diag(flow.covariance)))
        scales.append((flow(table.u, table.p) @ q_true / (q_true @ q_true) - 1) / flow.scale_sigma)
    # 2100 intervals, correlated within a seed: ±2 % is about three standard errors.
    assert abs(np.mean(covered) - 0.95) < 0.02
    assert np.mean(covered, axis=0).min() > 0.86
    assert 0.85 < np.std(scales) < 1.15  # the gauge scatters as scale_sigma says


def test_sigma_is_the_noise_of_a_map_without_misfit(spool_valve):
    table = spool_valve()
    q = fit_polynomials(table)(table.u, table.p)
    q = q + 2e-5 * np.random.default_rng(5).standard_normal(table.n)
    assert fit_polynomials(FlowMap(table.u, table.p, q)).sigma == pytest.approx(2e-5, rel=0.1)


def test_weights_favour_the_points_they_name(spool_valve):
    table = spool_valve()
    edge = table.p == table.p.max()
    plain = fit_polynomials(table).residuals(table)[edge]
    weighted = fit_polynomials(table, weights=np.where(edge, 1e4, 1.0)).residuals(table)[edge]
    assert np.sum(weighted**2) < 0.1 * np.sum(plain**2)


def test_a_common_factor_of_the_weights_changes_nothing(spool_valve):
    table = spool_valve(noise=1e-5)
    w = RNG.uniform(0.5, 2, table.n)
    a, b = fit_polynomials(table, weights=w), fit_polynomials(table, weights=1e10 * w)
    np.testing.assert_allclose(a.parameters.values, b.parameters.values, rtol=1e-9)
    np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-9)


@settings(max_examples=25)
@given(c=st.floats(1e-3, 20))
def test_the_flow_scale_is_a_gauge(c):
    u, p = (a.ravel() for a in np.meshgrid(np.linspace(-3, 3, 7), np.linspace(1e5, 7e5, 12)))
    q = (
        1e-3 * u * np.sqrt(1 - (p / 8e5) ** 2)
        + 1e-10 * (4e5 - p)
        + 1e-5 * np.sin(37 * np.arange(84))
    )
    curve = fit_polynomials(FlowMap(u, p, q))
    other = fit_polynomials(FlowMap(u, p, c * q))
    scales = curve.parameters.scales
    np.testing.assert_allclose(
        other.parameters.values / scales,
        c * curve.parameters.values / scales,
        rtol=1e-9,
        atol=1e-11,
    )
    np.testing.assert_allclose(other.parameters.scales, c * scales, rtol=1e-12)
    np.testing.assert_allclose(other.covariance, c**2 * curve.covariance, rtol=1e-7)
    assert other.sigma == pytest.approx(c * curve.sigma, rel=1e-9)
    assert other.scale_sigma == pytest.approx(curve.scale_sigma, rel=1e-9)
    assert (other.p_range, other.degrees, other.dof) == (curve.p_range, curve.degrees, curve.dof)


@pytest.mark.parametrize("kind", [ca.SX, ca.MX])
def test_numpy_and_casadi_agree_inside_and_outside_the_map(spool_valve, kind):
    flow = fit_polynomials(spool_valve(noise=1e-5))
    function = symbolic(flow, kind)
    expected = flow(U_TRY, P_TRY)
    computed = [float(function(u, p)[0]) for u, p in zip(U_TRY, P_TRY, strict=True)]
    assert np.abs(computed - expected).max() < 1e-15 * np.abs(expected).max() * 10
    rows = np.vstack([function(u, p)[2].full() for u, p in zip(U_TRY, P_TRY, strict=True)])
    np.testing.assert_allclose(rows, flow.design_matrix(U_TRY, P_TRY), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("kind", [ca.SX, ca.MX])
def test_derivatives_agree_with_finite_differences(spool_valve, kind):
    flow = fit_polynomials(spool_valve())
    function = symbolic(flow, kind)
    for u, p in [(2.0, 3e5), (-1.5, 1.2e5), (1.0, 6.9e5), (0.5, 7.5e5), (-2.0, 0.5e5)]:
        du, dp = function(u, p)[1].full().ravel()
        assert du == pytest.approx((flow(u + 1e-3, p) - flow(u - 1e-3, p)) / 2e-3, rel=1e-8)
        assert dp == pytest.approx((flow(u, p + 50.0) - flow(u, p - 50.0)) / 100.0, rel=1e-6)


def test_at_zero_command_the_flow_is_phi_and_the_gain_depends_on_the_sign(spool_valve):
    flow = fit_polynomials(spool_valve())
    p = np.linspace(1e5, 7e5, 9)
    no_gain = flow.parameters.with_values(
        {name: 0.0 for name in flow.parameters.names if name.startswith("psi")}
    )
    np.testing.assert_array_equal(flow(0.0, p), flow.with_theta(no_gain.values)(3.0, p))
    plus, minus = flow(1e-9, p) - flow(0.0, p), flow(0.0, p) - flow(-1e-9, p)
    assert np.all(np.abs(plus - minus) > 0.01 * np.abs(plus))


def test_the_continuation_is_c1_and_straight(spool_valve):
    flow = fit_polynomials(spool_valve())
    derivative = symbolic(flow, ca.SX)
    for edge, outward in zip(flow.p_range, (-1.0, 1.0), strict=True):
        for u in (-3.0, -0.1, 0.0, 0.1, 3.0):
            inside = float(derivative(u, edge - outward * 1e-4)[1][1])
            outside = float(derivative(u, edge + outward * 1e-4)[1][1])
            assert inside == pytest.approx(outside, rel=1e-6, abs=1e-18)
            value = flow(u, edge)
            for reach in (1.0, 1e4, 5e5):
                expected = value + outside * outward * reach
                assert flow(u, edge + outward * reach) == pytest.approx(expected, abs=1e-14)
    np.testing.assert_allclose(
        edge_slopes(flow, [2.0])[0],
        [float(derivative(2.0, p)[1][1]) for p in (0.5e5, 8e5)],
        rtol=1e-12,
    )


def test_an_edge_where_flow_rises_with_pressure_is_warned_of(caplog):
    u, p = (a.ravel() for a in np.meshgrid(np.linspace(-3, 3, 7), np.linspace(1e5, 7e5, 12)))
    fit_polynomials(FlowMap(u, p, 1e-3 * u * (1 + ((p - 4e5) / 3e5) ** 2)), degrees=(2, 2, 2))
    assert "rises with pressure for u from 0.3 to 3 V" in caplog.text
    assert "upper edge (p = 7e+05 Pa)" in caplog.text


def test_a_real_valve_gets_no_warning(spool_valve, caplog):
    fit_polynomials(spool_valve(noise=1e-5))
    assert not caplog.text


def test_monomials_are_the_coefficients_of_the_paper(spool_valve):
    flow = fit_polynomials(spool_valve())
    coefficients = flow.monomials()
    assert [len(c) for c in coefficients.values()] == [8, 8, 5]
    p = np.linspace(1e5, 7e5, 50)
    phi, plus, minus = (np.polynomial.polynomial.polyval(p, c) for c in coefficients.values())
    # Powers of the pressure cancel: ten digits are left of sixteen.
    assert np.abs(phi + plus * 2.0 - flow(2.0, p)).max() < 1e-10 * 0.02
    assert np.abs(phi + minus * -2.0 - flow(-2.0, p)).max() < 1e-10 * 0.02


def test_a_polynomial_that_was_left_out_has_no_monomials():
    p = np.linspace(1e5, 7e5, 12)
    flow = fit_polynomials(FlowMap(np.ones(12), p, 1e-8 * (7e5 - p)), degrees=(1, -1, -1))
    coefficients = flow.monomials()
    np.testing.assert_allclose(coefficients["phi"], [7e-3, -1e-8], rtol=1e-9)
    assert coefficients["psi_plus"].shape == coefficients["psi_minus"].shape == (0,)


def test_the_problem_is_well_conditioned_where_powers_of_pressure_are_singular(spool_valve):
    table = spool_valve(n_u=41)
    flow = fit_polynomials(table)
    D = flow.design_matrix(table.u, table.p) * flow.parameters.scales
    assert np.linalg.cond(D) < 10
    assert np.linalg.cond(np.vander(table.p, 8)) > 1e16


def test_theta_is_replaced_in_a_copy(spool_valve):
    flow = fit_polynomials(spool_valve())
    double = flow.with_theta(2 * flow.parameters.values)
    np.testing.assert_allclose(double(1.0, 3e5), 2 * flow(1.0, 3e5))
    assert flow.parameters.names[0] == "phi_0"
    assert flow.parameters["psi_minus_4"].unit == "kg/(s V)"
    with pytest.raises(ModelError, match="expected 21 values"):
        flow.with_theta([1.0])


def test_the_expression_is_small(spool_valve):
    """It is evaluated in the inner loop of the integrator."""
    assert flow_function(fit_polynomials(spool_valve())).n_instructions() < 125


def test_a_single_opening_is_a_polynomial_in_pressure_alone():
    p = np.linspace(1e5, 7e5, 12)
    flow = fit_polynomials(FlowMap(np.ones(12), p, 1e-8 * (7e5 - p)), degrees=(1, -1, -1))
    assert flow.parameters.names == ("phi_0", "phi_1")
    assert flow(3.0, 4e5) == pytest.approx(3e-3)
    assert float(flow_function(flow)(3.0, 4e5, flow.parameters.values)) == pytest.approx(3e-3)


@pytest.mark.parametrize(
    ("degrees", "message"),
    [
        ((7, 7), "three whole numbers"),
        ((7, 7, 21), "three whole numbers"),
        ((4, 1, 1), "phi of degree 4 needs 5 distinct pressures, the map has 4"),
        ((1, 5, 1), "psi_plus of degree 5 needs 6 distinct pressures at u > 0"),
    ],
)
def test_degrees_that_the_map_cannot_carry_are_refused(degrees, message):
    u, p = (a.ravel() for a in np.meshgrid([-1.0, 0.0, 1.0], [1e5, 2e5, 3e5, 4e5]))
    with pytest.raises((CaseError, ModelError), match=message):
        fit_polynomials(FlowMap(u, p, 1e-3 * u), degrees=degrees)


def test_a_map_without_exhaust_side_cannot_give_psi_minus(spool_valve):
    table = spool_valve()
    with pytest.raises(CaseError, match=r"psi_minus .* at u < 0, the map has 0"):
        fit_polynomials(table.select(table.u >= 0))


def test_one_opening_does_not_tell_leakage_from_gain():
    p = np.linspace(1e5, 7e5, 12)
    with pytest.raises(CaseError, match="do not determine all 4 coefficients"):
        fit_polynomials(FlowMap(np.ones(12), p, 1e-8 * (7e5 - p)), degrees=(1, 1, -1))


def test_mixed_supply_pressures_are_refused(spool_valve):
    table = spool_valve()
    mixed = FlowMap(table.u, table.p, table.q_m, p_supply=np.where(table.u > 0, 7e5, 8e5))
    with pytest.raises(CaseError, match="supply pressures from 700000 to 800000 Pa"):
        fit_polynomials(mixed)


def test_cross_validation_finds_the_degrees_of_a_polynomial_map():
    u, p = (a.ravel() for a in np.meshgrid(np.linspace(-3, 3, 21), np.linspace(1e5, 7e5, 25)))
    z = (p - 4e5) / 3e5
    T = np.polynomial.chebyshev.chebval
    q = (
        1e-4 * T(z, [0, 1, 0.5])
        + np.where(u > 0, 1e-3 * T(z, [1, 0, 0, 0.3, 0.2]), 1e-3 * T(z, [1, 0.2, 0, 0.1])) * u
    )
    q += 2e-5 * np.random.default_rng(0).standard_normal(q.size)
    selection = select_degrees(FlowMap(u, p, q))
    assert selection.chosen == (2, 4, 3)
    assert selection.at_limit == ()
    best = selection.table.iloc[0]
    assert best["rms"] == pytest.approx(2e-5, rel=0.1)
    assert set(selection.table.columns) >= {"phi", "psi_plus", "psi_minus", "n", "rms", "percent"}


def test_cross_validation_withholds_whole_columns_and_rows():
    """A bump in single columns is noise to the other columns: more degrees must not pay."""
    u, p = (a.ravel() for a in np.meshgrid(np.linspace(-3, 3, 21), np.linspace(1e5, 7e5, 25)))
    column = np.random.default_rng(2).standard_normal(25)[np.searchsorted(np.unique(p), p)]
    q = 1e-3 * u * (8e5 - p) / 7e5 + 5e-5 * column
    assert select_degrees(FlowMap(u, p, q)).chosen[0] <= 2


@pytest.mark.parametrize("seed", [0, 1])
def test_the_held_out_error_is_that_between_columns_of_measured_pressures(spool_valve, seed):
    table = spool_valve(noise=3e-5, n_p=7, seed=seed, scatter=3e3)
    selection = select_degrees(table)
    between = spool_valve(n_u=41, n_p=201)
    error = fit_polynomials(table, selection.chosen).residuals(between)
    error = error[np.abs(between.p - 4e5) < 2.7e5]
    held_out = selection.table.set_index(["phi", "psi_plus", "psi_minus"]).rms[selection.chosen]
    assert np.sqrt(np.mean(error**2)) < 1.2 * held_out
    assert selection.table[["phi", "psi_plus", "psi_minus"]].to_numpy().max() <= 6


def test_scattered_pressures_of_one_column_count_once(spool_valve):
    table = spool_valve(n_p=7, scatter=3e3)
    with pytest.raises(CaseError, match="phi of degree 7 needs 8 distinct pressures, the map has"):
        fit_polynomials(table)


def test_too_many_folds_are_refused(spool_valve):
    with pytest.raises(CaseError, match="do not make 30 folds"):
        select_degrees(spool_valve(), folds=30)


def test_the_fit_of_the_paper_on_the_table1_map(table1):
    """Degrees (7, 7, 4) leave 0.37 % rms: the square-root fall to zero flow is no polynomial."""
    flow = fit_polynomials(table1)
    view = map_residuals(table1, flow)
    assert view.rms_percent == pytest.approx(0.366, abs=0.005)
    assert view.max_percent == pytest.approx(2.21, abs=0.02)
    worst = view.p[np.argmax(np.abs(view.residual))]
    assert worst > 0.95 * table1.p_range[1]
    assert flow.scale_sigma < 5e-4
    assert np.all(edge_slopes(flow, np.linspace(-3, 3, 13)) < 0)


def test_the_table1_map_grows_with_the_command(table1):
    flow = fit_polynomials(table1)
    u = np.linspace(-5, 5, 101)[:, None]
    p = np.linspace(1.06e5, 6.95e5, 60)
    assert np.all(np.diff(flow(u, p), axis=0) > 0)


def test_cross_validation_on_table1_asks_for_more_than_degree_four_at_the_exhaust(table1):
    selection = select_degrees(table1)
    assert selection.chosen[0] <= 2  # leakage needs few
    assert min(selection.chosen[1:]) >= 8
    rows = selection.table.set_index(["phi", "psi_plus", "psi_minus"])["percent"]
    assert rows[7, 7, 4] == pytest.approx(0.42, abs=0.02)
    assert rows[selection.chosen] < 0.7 * rows[7, 7, 4]
