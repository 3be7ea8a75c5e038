"""Two effects in the place of one that stands for both."""

from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA
from pneumo_casadi.diagnosis.select import split
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger
from pneumo_casadi.diagnosis.select.split import split_effects

FINAL = ("hose", "shift")
PAIR = ("hose", "leak_P", "leak_N")
#: Of each effect: those with which it says it is confused.
CONFUSED = {"hose": (), "shift": (), "leak_P": ("shift",), "leak_N": ("shift",), "drag": ()}
#: Cost alone in the place of the shift, beside the hose.
IN_PLACE = {"leak_P": 700.0, "leak_N": 650.0}


@pytest.fixture
def ledger(monkeypatch):
    """A hose and a shift are found; two leaks in the shift's place cost and leave what is given."""
    monkeypatch.setattr(FitLedger, "__post_init__", lambda self: None)
    monkeypatch.setattr(split, "residual_rms", lambda fitted: np.array(fitted.residual))

    def made(cost=100.0, residual=(0.8, 1.0), one_form=True):
        kept = FitLedger(SimpleNamespace(criteria=CRITERIA), dict.fromkeys(CONFUSED))
        kept.directions = dict.fromkeys(CONFUSED, ())
        costs = {FINAL: 400.0, PAIR: cost, ("drag",): 800.0}
        costs |= {(name,): 900.0 for name in IN_PLACE}
        costs |= {("hose", name): value for name, value in IN_PLACE.items()}
        known = {
            key: SimpleNamespace(cost=value, values={f"{key[-1]}.size": value}, residual=(1.0, 1.0))
            for key, value in costs.items()
        }
        known[PAIR].residual = residual
        kept.fits = {key: known[key] for key in known if len(key) == 1 or key == FINAL}
        kept.effects = lambda names: tuple(
            SimpleNamespace(name=name, cause=name, confused_with=CONFUSED[name], one_form=one_form)
            for name in names
        )
        kept.asked = {}

        def fit_all(starts):
            kept.asked.update(starts)
            kept.fits.update({key: known[key] for key in starts if key in known})

        kept.fit_all = fit_all
        return kept

    return made


def test_two_leaks_replace_a_shift_that_stands_for_both(ledger):
    kept = ledger()
    assert split_effects(kept, FINAL, 6) == PAIR
    assert set(kept.asked) == {("hose", "leak_P"), ("hose", "leak_N"), PAIR}
    assert kept.asked[PAIR].values["leak_P.size"] == IN_PLACE["leak_P"]


@pytest.mark.parametrize(
    ("why", "given"),
    [
        ("it gains less than another form must", {"cost": 400.0 - 0.9 * CRITERIA.form_gain}),
        ("held-out records do not show it", {"residual": (0.8, 1.4)}),
        ("no balance improves by a size that matters", {"residual": (0.97, 1.0)}),
        ("of a hose other forms are known", {"one_form": False}),
    ],
)
def test_the_one_effect_stays_where(ledger, why, given):
    assert split_effects(ledger(**given), FINAL, 6) == FINAL, why


def test_a_model_gets_no_more_effects_than_it_may_have(ledger):
    kept = ledger()
    assert split_effects(kept, FINAL, 2) == FINAL
    assert not kept.asked
