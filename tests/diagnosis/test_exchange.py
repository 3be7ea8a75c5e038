"""One effect for another in a final model, and how many effects a balance may get."""

from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA
from pneumo_casadi.diagnosis.select import exchange, forward_selection
from pneumo_casadi.diagnosis.select.exchange import exchange_effects
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger
from pneumo_casadi.diagnosis.select.forward_selection import _acting

FINAL = ("lag", "shift")
RIVAL = ("hose", "shift")


def as_fitted(cost, residual):
    return SimpleNamespace(cost=cost, residual=residual)


@pytest.fixture
def ledger(monkeypatch):
    """A lag and a shift are found; what a hose in the lag's place costs and leaves is given."""
    monkeypatch.setattr(FitLedger, "__post_init__", lambda self: None)
    monkeypatch.setattr(exchange, "residual_rms", lambda fitted: np.array(fitted.residual))
    monkeypatch.setattr(exchange, "fit_rivals", lambda *given: None)
    monkeypatch.setattr(exchange, "motion_is_hidden", lambda effects, fitted: effects == ("play",))

    def made(cost=100.0, residual=(0.8, 1.0), key=RIVAL):
        kept = FitLedger(SimpleNamespace(criteria=CRITERIA), {})
        kept.fits = {
            FINAL: as_fitted(400.0, (1.0, 1.0)),
            key: as_fitted(cost, residual),
            ("lag",): as_fitted(0.0, (0.1, 0.1)),
            ("drag", "spring"): as_fitted(0.0, (0.1, 0.1)),
        }
        kept.effects = lambda names: ("play",) if "play" in names else names
        kept.refined = []
        kept.refine = kept.refined.append
        return kept

    return made


def test_what_fits_better_in_the_place_of_one_effect_takes_it(ledger):
    kept = ledger()
    assert exchange_effects(kept, None, FINAL) == RIVAL
    assert kept.refined == [RIVAL]


@pytest.mark.parametrize(
    ("why", "given"),
    [
        ("it gains less than another form must", {"cost": 400.0 - 0.9 * CRITERIA.form_gain}),
        ("held-out records do not show it", {"residual": (0.8, 1.4)}),
        ("no balance improves by a size that matters", {"residual": (0.97, 1.0)}),
        ("where the motion is hidden, the balances do not tell", {"key": ("play", "shift")}),
    ],
)
def test_the_model_stays_where(ledger, why, given):
    assert exchange_effects(ledger(**given), None, FINAL) == FINAL, why


@pytest.mark.parametrize(
    ("left", "in_flow", "in_force"),
    [
        ([(8, 8), (4, 8), (4, 4), (4, 2)], 1, 2),
        ([(8, 8), (4, 4), (2, 2), (1, 1)], 3, 3),
        ([(8, 8), (7.9, 4)], 0, 1),
    ],
)
def test_effects_count_in_the_balances_that_they_act_in(monkeypatch, left, in_flow, in_force):
    """Three weak effects of the load are no reason to give up a leak, nor the other way round."""
    monkeypatch.setattr(forward_selection, "residual_rms", lambda fitted: np.array(fitted.residual))
    fits = [
        SimpleNamespace(effects=("a", "b", "c")[:number], residual=residual)
        for number, residual in enumerate(left)
    ]
    found = [_acting(fits, balance, CRITERIA.matters) for balance in (0, 1)]
    assert found == [in_flow, in_force]
