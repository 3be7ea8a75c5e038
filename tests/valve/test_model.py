"""What holds for every flow model: one interface, one meaning."""

import pickle

import casadi as ca
import numpy as np
import pytest

from pneumo_casadi.valve import (
    fit_iso6358,
    fit_iso6358_curve,
    fit_polynomials,
    fit_spline,
    flow_function,
)
from pneumo_casadi.valve.flow_pair import FlowPair

FITS = [fit_polynomials, fit_spline, fit_iso6358, fit_iso6358_curve]


@pytest.fixture(scope="module")
def table(spool_valve):
    return spool_valve(noise=1e-5)


@pytest.fixture(scope="module", params=FITS, ids=lambda fit: fit.__name__)
def fit(request):
    return request.param


@pytest.fixture(scope="module")
def flow(fit, table):
    return fit(table)


def test_the_expression_at_the_fitted_parameters_is_the_call(flow):
    function = flow_function(flow)
    for u, p in [(1.0, 3e5), (-2.0, 1.5e5), (0.0, 4e5), (3.5, 8e5)]:
        value = float(function(u, p, flow.parameters.values))
        assert value == pytest.approx(float(flow(u, p)), rel=1e-12)


def test_calls_broadcast_and_keep_their_shape(flow):
    u, p = np.linspace(-1, 1, 3)[:, None], np.linspace(2e5, 6e5, 4)
    assert flow(u, p).shape == (3, 4)
    assert flow(u, p)[2, 1] == pytest.approx(float(flow(u[2, 0], p[1])), rel=1e-14)
    assert flow([], []).shape == (0,)


def test_residuals_have_the_reported_standard_deviation(flow, table):
    dof = getattr(flow, "dof", table.n - np.isfinite(np.diag(flow.covariance)).sum())
    assert np.sqrt(np.sum(flow.residuals(table) ** 2) / dof) == pytest.approx(flow.sigma, rel=1e-9)


def test_the_scale_is_as_uncertain_as_the_scatter_over_the_flow(flow, table):
    expected = flow.sigma / np.linalg.norm(flow(table.u, table.p))
    assert flow.scale_sigma == pytest.approx(expected, rel=1e-3)


def test_the_covariance_is_symmetric_positive_and_read_only(flow):
    n = len(flow.parameters)
    known = np.isfinite(np.diag(flow.covariance))
    C = flow.covariance[np.ix_(known, known)]
    correlation = C / np.sqrt(np.outer(np.diag(C), np.diag(C)))
    assert flow.covariance.shape == (n, n)
    assert np.linalg.eigvalsh((correlation + correlation.T) / 2).min() > 0
    with pytest.raises(ValueError, match="read-only"):
        flow.covariance[0, 0] = 0.0


def test_a_model_survives_pickling_as_worker_processes_need(flow):
    copy = pickle.loads(pickle.dumps(flow))
    np.testing.assert_array_equal(copy([1.0, -1.0], 3e5), flow([1.0, -1.0], 3e5))


def test_the_flow_falls_with_pressure_beyond_the_map(fit, spool_valve):
    """So that a chamber driven outside is carried back."""
    flow = fit(spool_valve(noise=1e-6))
    for u in (-3.0, 0.0, 3.0):
        assert flow(u, 9e5) < flow(u, 7e5)
        # Choked inlet flow is flat below: noise and wiggle may tilt it a little.
        assert flow(u, 0.5e5) > flow(u, 1e5) - 0.005 * 0.016


def test_the_symbol_tells_what_the_expression_can_be_written_in(flow):
    kinds = {"SX": (ca.SX, ca.MX), "MX": (ca.MX,)}[flow.symbol]
    for kind in kinds:
        u, p = kind.sym("u"), kind.sym("p")
        theta = kind.sym("theta", len(flow.parameters))
        assert isinstance(flow.expression(u, p, theta), kind)


def test_two_valves_cover_the_commands_that_one_or_the_other_was_metered_at(spool_valve):
    table = spool_valve()
    less = fit_polynomials(table.select(table.u < 1.0), (1, 1, 1))
    pair = FlowPair(less, fit_polynomials(table.select(table.u > -2.0), (1, 1, 1)))
    assert pair.u_range == (-3.0, 3.0) and less.u_range[1] < 1.0
