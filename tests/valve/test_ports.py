"""The static map at other supply and exhaust pressures than those it was metered at."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from pneumo_casadi.valve import (
    fit_iso6358,
    fit_iso6358_curve,
    fit_polynomials,
    fit_spline,
    orifice_flow,
)
from pneumo_casadi.valve.flow_model import FlowModel

P_SUPPLY, P_EXT = 7e5, 1e5


@pytest.fixture(
    scope="module",
    params=[fit_polynomials, fit_spline, fit_iso6358, fit_iso6358_curve],
    ids=lambda fit: fit.__name__,
)
def form(request, spool_valve) -> SimpleNamespace:
    flow: FlowModel = request.param(spool_valve())
    symbol = {"SX": ca.SX, "MX": ca.MX}[flow.symbol]
    u, p, filling, emptying = (symbol.sym(name) for name in ("u", "p", "s", "e"))
    q = flow.expression_at(u, p, ca.DM(flow.parameters.values), filling, emptying)
    function = ca.Function("q", [u, p, filling, emptying], [q])

    def at(*arguments):
        rows = np.broadcast_arrays(*(np.asarray(a, dtype=float) for a in arguments))
        return function(*(a.reshape(1, -1) for a in rows)).full().ravel()

    return SimpleNamespace(flow=flow, at=at)


def true_valve(u, p, filling, emptying):
    inlet = orifice_flow(1.0, 0.3, 0.5, P_SUPPLY * filling, p) * (3e-9 * np.maximum(u, 0) + 2e-10)
    outlet = orifice_flow(1.0, 0.3, 0.5, p, P_EXT * emptying) * (4e-9 * np.maximum(-u, 0) + 2e-10)
    return inlet - outlet


def test_at_the_metered_pressures_it_is_the_metered_map(form):
    u, p = (a.ravel() for a in np.meshgrid(np.linspace(-3, 3, 13), np.linspace(1e5, 7e5, 13)))
    np.testing.assert_allclose(form.at(u, p, 1.0, 1.0), form.flow(u, p), rtol=1e-9, atol=1e-15)


def greatest_error(form, filling, emptying):
    grid = np.meshgrid(np.linspace(-3, 3, 13), np.linspace(1e5 * emptying, 7e5 * filling, 61))
    u, p = (a.ravel() for a in grid)
    return np.abs(form.at(u, p, filling, emptying) - true_valve(u, p, filling, emptying)).max()


@pytest.mark.slow
@pytest.mark.parametrize(("filling", "emptying"), [(0.9, 1.0), (1.05, 1.0), (1.0, 1.5), (0.9, 1.5)])
def test_other_pressures_cost_no_more_than_the_misfit_of_the_metered_map(form, filling, emptying):
    allowed = max(filling, emptying) * greatest_error(form, 1.0, 1.0) + 1e-7
    assert greatest_error(form, filling, emptying) < 1.4 * allowed


def test_it_is_continuous_where_the_valve_changes_edges(form):
    p = np.linspace(0.8e5, 7.5e5, 30)
    jump = form.at(1e-9, p, 0.9, 1.4) - form.at(-1e-9, p, 0.9, 1.4)
    assert np.abs(jump).max() < 1e-10


def test_back_pressure_does_not_reach_a_choked_exhaust(form):
    """Choked below b = 0.3: from 1.5 bar the outlet may be at 5 bar or more."""
    u, p = -3.0, np.linspace(5.5e5, 7e5, 7)
    free, throttled = form.at(u, p, 1.0, 1.0), form.at(u, p, 1.0, 1.5)
    assert np.abs(throttled / free - 1).max() < 0.02  # a quartic is not straight
    u, p = -3.0, np.linspace(1.6e5, 2.5e5, 7)
    free, throttled = form.at(u, p, 1.0, 1.0), form.at(u, p, 1.0, 1.5)
    assert np.all(throttled > 0.95 * free)
