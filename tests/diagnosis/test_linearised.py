"""A fit with what effects know of their own parameters, linearised."""

import numpy as np
import pytest

from pneumo_casadi.diagnosis import prepare_study
from pneumo_casadi.diagnosis.discover.linear.linearised import linearise
from pneumo_casadi.diagnosis.discover.linear.sites import Site
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

    kept = {share: linear.keeps_mass(site, inertia, np.array([share * M])) for share in (-1, 0, 1)}
    assert kept[0] and list(kept.values()).count(False) == 1
    assert all(linear.keeps_mass(site, inertia, np.array([s * M])) for s in (-0.5, 0.5))


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
