"""A fit with what effects know of their own parameters, linearised."""

from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis import prepare_study
from pneumo_casadi.diagnosis.discover.linear.linearised import Linearised, linearise
from pneumo_casadi.diagnosis.discover.linear.signals import Signals
from pneumo_casadi.diagnosis.discover.linear.sites import Site
from pneumo_casadi.diagnosis.discover.search import search
from pneumo_casadi.diagnosis.metrics.residual_size import balance_levels
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.diagnosis.screen.background import background
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.effects.term import Term, term_effect
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.residuals import balance_residuals


@pytest.fixture(scope="module")
def curved(made_case):
    """A study with the fit of a curve, which is held by a prior where records say little."""
    study, _ = prepare_study(made_case(12, position_friction="large"))
    effects = (EFFECTS["position_friction_curve"](),)
    return study, fit_model(study, effects), effects


def test_a_fit_at_its_minimum_asks_for_no_step(curved):
    """Without the prior its curve was asked to change by hundreds of its scales."""
    linear = linearise(*curved)
    step = dict(zip(linear.names, linear.parameter_change(linear.e), strict=True))
    assert max(abs(size) for name, size in step.items() if "curve" in name) < 0.5


def test_a_refit_absorbs_no_more_than_the_prior_of_a_curve_allows(curved):
    study, fitted, effects = curved
    behind = background(study, fitted, fitted, effects)
    taken = behind.Q.T @ behind.e
    assert taken @ taken < 1e-3 * (behind.e @ behind.e)
    assert not np.any(behind.of_balance[:, -1])  # a row of the prior belongs to no balance


def test_a_term_that_cancels_inertia_is_none(curved):
    """Friction as large as |p_P − p_N| times the area had been told of a vibration, closing all."""
    linear = linearise(*curved)
    motion, M = linear.train.motions[0], linear.mass
    site = Site(("force",), "1", "t")

    def inertia(t):
        return np.interp(t, motion.t, motion.dx[-1])[:, None]

    kept = {
        share: linear.keeps_mass(site, inertia, np.array([share * M]))
        for share in (-0.95, -0.5, 0.5, 0.95)
    }
    # A force of −M a does what the mass did, and next to nothing is left of it.
    assert kept == {-0.95: False, -0.5: True, 0.5: True, 0.95: True}


def test_no_formula_that_cancels_inertia_is_proposed(curved, monkeypatch):
    levels = balance_levels(curved[0])
    linear = linearise(*curved)
    assert search(linear, levels)
    monkeypatch.setattr(Linearised, "keeps_mass", lambda self, site, basis, c: False)
    assert search(linear, levels) == ()


@pytest.mark.parametrize("balances", [("mass_flow_P",), ("mass_flow_P", "mass_flow_N")], ids=len)
@pytest.mark.parametrize("factor", ["dq_m/du", "±dq_m/du"])
def test_a_shifted_command_is_linearised_as_its_effect_shifts_it(curved, balances, factor):
    study, fitted, effects = curved
    linear = linearise(*curved)
    shift = 1e-3
    term = Term("wander", balances, factor, "t", "constant", {"level": shift})
    base = study.axis.with_effects(*effects, term_effect(term)()).at_starting_values()
    axes = (base.with_parameters({**fitted.values, "wander.level": u}) for u in (shift, 0.0))
    motion, used = study.smoothed[0][0], fitted.used_train[0]
    moved, still = (
        balance_residuals(BalanceFunctions(axis), motion, axis.parameters.values) for axis in axes
    )
    expected = ((moved - still) / linear.train.sigma[:, None])[used]
    site = Site(balances, factor, "t")
    columns = linear.train.columns(site, lambda t: np.full((t.size, 1), shift))[:, 0]
    assert np.ptp(expected) > 0
    np.testing.assert_allclose(columns, expected, atol=0.05 * np.abs(expected).max())


@pytest.mark.parametrize("supplied", [False, True], ids=["stated supply", "recorded supply"])
def test_a_shift_of_the_command_is_small_beside_the_command(made, supplied):
    """With a recorded supply of 7e5 Pa among the inputs a step of 700 V had been taken."""
    axis = made.supplied_axis() if supplied else made.true_axis()
    u = {"u_P": [1.0, -1.5, 0.0], "u_N": [-1.0, 1.5, 0.0], "p_supply": [6e5, 6e5, 6e5]}
    x = np.array([[4e5, 3e5, 5e5], [5e5, 4e5, 5e5], [0.0, 0.01, 0.02], [0.1, -0.1, 0.0]])
    inputs = np.array([u[name] for name in axis.inputs])
    motion = SimpleNamespace(x=x, dx=np.zeros_like(x), u=inputs, N=3, t=np.arange(3.0))
    slopes = Signals(axis, motion).factor("mass_flow_P", "dq_m/du")
    slopes = slopes / Signals(axis, motion).gain("mass_flow_P")
    theta, h = axis.parameters.values, 1e-4

    def flow(k, shift):
        moved = inputs[:, k].copy()
        moved[axis.inputs.index("u_P")] += shift
        return float(axis.valve_flow(x[:, k], moved, theta)[0])

    expected = [(flow(k, h) - flow(k, -h)) / (2 * h) for k in range(3)]
    assert slopes == pytest.approx(expected, rel=0.02)
