"""The spline map: same interface, no misfit, a kink at u = 0, straight outside."""

import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import NdBSpline

from pneumo_casadi.errors import CaseError
from pneumo_casadi.valve import FlowMap, fit_polynomials, fit_spline, flow_function, map_residuals

RNG = np.random.default_rng(3)


def test_numpy_casadi_and_scipy_agree(spool_valve):
    flow = fit_spline(spool_valve(noise=1e-5))
    u, p = RNG.uniform(-4, 4, 60), RNG.uniform(0.2e5, 9e5, 60)
    knots, degrees = (flow.knots_u, flow.knots_p), (flow.degree_u, flow.degree_p)
    reference = NdBSpline(knots, flow.coefficients, degrees)(np.column_stack([u, p]))
    symbolic = flow_function(flow)
    computed = [float(symbolic(a, b, 1.0)) for a, b in zip(u, p, strict=True)]
    assert np.abs(flow(u, p) - reference).max() < 1e-12 * np.abs(reference).max()
    assert np.abs(flow(u, p) - computed).max() < 1e-12 * np.abs(reference).max()


def test_derivatives_agree_with_finite_differences(spool_valve):
    flow = fit_spline(spool_valve(noise=1e-5))
    u, p = ca.MX.sym("u"), ca.MX.sym("p")
    q = flow.expression(u, p, ca.DM([1.0]))
    gradient = ca.Function("g", [u, p], [ca.gradient(q, ca.vertcat(u, p))])
    for a, b in [(1.0, 2e5), (-1.0, 6.8e5), (2.9, 1.1e5), (-0.01, 4e5), (1.0, 9e5)]:
        du, dp = gradient(a, b).full().ravel()
        assert du == pytest.approx((flow(a + 1e-4, b) - flow(a - 1e-4, b)) / 2e-4, rel=1e-5)
        assert dp == pytest.approx((flow(a, b + 1) - flow(a, b - 1)) / 2, rel=1e-5, abs=1e-15)


def test_the_kink_at_zero_command_is_sharp(spool_valve):
    flow = fit_spline(spool_valve())
    step = 1e-4
    right = (flow(step, 4e5) - flow(0.0, 4e5)) / step
    left = (flow(0.0, 4e5) - flow(-step, 4e5)) / step
    table = spool_valve()
    u, _, q = table.grid()
    i = np.searchsorted(u, 0.0)
    column = q[:, np.searchsorted(np.unique(table.p), 4e5)]
    assert right == pytest.approx((column[i + 1] - column[i]) / (u[i + 1] - u[i]), rel=2e-3)
    assert left == pytest.approx((column[i] - column[i - 1]) / (u[i] - u[i - 1]), rel=2e-3)
    assert abs(right - left) > 0.1 * abs(right)


def test_the_continuation_is_c1_and_straight(spool_valve):
    flow = fit_spline(spool_valve())
    step = 1e-3
    for edge, outward in zip(flow.p_range, (-1, 1), strict=True):
        for u in (-3.5, -1.0, 0.0, 2.0, 3.5):
            inside = (flow(u, edge) - flow(u, edge - outward * step)) / step
            outside = (flow(u, edge + outward * 1e6) - flow(u, edge)) / 1e6
            assert outside == pytest.approx(inside, rel=1e-4, abs=1e-12)
            half = flow(u, edge + outward * 5e5) - flow(u, edge)
            assert half == pytest.approx(5e5 * outside, abs=1e-13)
    for edge, outward in zip(flow.u_range, (-1, 1), strict=True):
        inside = (flow(edge, 3e5) - flow(edge - outward * 1e-6, 3e5)) / 1e-6
        assert flow(edge + outward * 2, 3e5) - flow(edge, 3e5) == pytest.approx(
            2 * inside, rel=1e-4
        )


def test_sigma_is_the_noise_and_the_misfit_is_below_it(spool_valve):
    noise = 2e-5
    exact, table = spool_valve(), spool_valve(noise=noise)
    flow = fit_spline(table)
    assert flow.sigma == pytest.approx(noise, rel=0.1)
    assert 50 < flow.dof < table.n
    smoothing = exact.q_m - flow(exact.u, exact.p)
    assert np.sqrt(np.mean(smoothing**2)) < noise
    polynomial = fit_polynomials(table)
    assert np.sum(smoothing**2) < 0.5 * np.sum(polynomial.residuals(exact) ** 2)


def test_the_gain_is_the_gauge(spool_valve):
    flow = fit_spline(spool_valve(noise=1e-5))
    assert flow.parameters.names == ("flow_gain",)
    np.testing.assert_allclose(flow.with_theta([1.1])(1.0, 3e5), 1.1 * flow(1.0, 3e5))
    table = spool_valve()
    expected = flow.sigma / np.linalg.norm(table.q_m)
    assert flow.scale_sigma == pytest.approx(expected, rel=1e-3)


def test_scattered_points_serve_as_well(spool_valve):
    grid = spool_valve(n_u=41)
    keep = np.sort(RNG.permutation(grid.n)[: grid.n // 2])
    table = grid.select(keep)
    assert not table.is_grid
    error = fit_spline(table).residuals(grid)
    assert np.sqrt(np.mean(error**2)) < 0.005 * grid.q_max


@pytest.mark.parametrize("scatter", [0.0, 200.0, 3000.0])
def test_scatter_of_the_pressures_does_not_set_the_spline_free_between_columns(
    spool_valve, scatter
):
    between = spool_valve(n_u=41, n_p=201)
    between = between.select((between.p > 1.3e5) & (between.p < 6.7e5))
    for seed in range(3):
        flow = fit_spline(spool_valve(noise=3e-5, n_p=7, seed=seed, scatter=scatter))
        assert np.abs(flow.residuals(between)).max() < 0.1 * between.q_max


def test_too_few_pressures_are_refused():
    u, p = (a.ravel() for a in np.meshgrid([-1.0, 0.0, 1.0], [1e5, 2e5, 3e5]))
    with pytest.raises(CaseError, match="3 distinct pressures; a spline needs at least 4"):
        fit_spline(FlowMap(u, p, 1e-3 * u))


def test_the_table1_map_is_met_to_its_noise(table1):
    flow = fit_spline(table1)
    view = map_residuals(table1, flow)
    assert view.rms_percent == pytest.approx(0.0905, abs=0.003)
    assert view.max_percent < 0.35
    assert flow.sigma == pytest.approx(1.09e-5, rel=0.02)
