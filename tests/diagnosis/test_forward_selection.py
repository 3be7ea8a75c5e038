"""How many effects forward selection takes, and when its model is completed."""

from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA
from pneumo_casadi.diagnosis.select import forward_selection
from pneumo_casadi.diagnosis.select.complete import Completed
from pneumo_casadi.diagnosis.select.forward_selection import (
    _backtrack,
    _completed,
    _may_be_named,
    _needs_more,
    acting_effects,
)

FINAL = ("stribeck",)
WHOLE = Completed(("hose", "stribeck"), FINAL)
SIMULATED = Completed(("leakage_P", "stribeck"), FINAL)


def fitted(force):
    """A fit that leaves this residual of the force, in noise floors."""
    rows = (np.outer((1.0, 1.0, force), np.ones(64)),)
    used = (np.ones((3, 64), dtype=bool),)
    return SimpleNamespace(held_out=rows, train=rows, used_held_out=used, used_train=used)


@pytest.mark.parametrize(
    ("left", "hides", "tried", "slow", "expected"),
    [
        (2.0, False, False, False, WHOLE),
        # What is left has another cause: effects more would take up parts of it.
        (6.0, False, False, False, Completed(FINAL, FINAL)),
        # The balances do not tell: sensors hide the motion, or the records are too slow for
        # accelerations.
        (2.0, True, False, False, Completed(FINAL, FINAL)),
        (2.0, False, False, True, Completed(FINAL, FINAL)),
        (2.0, False, True, True, Completed(FINAL, FINAL)),
        # Simulations have decided, and go on to.
        (2.0, True, True, False, SIMULATED),
        (6.0, False, True, False, SIMULATED),
    ],
)
def test_a_model_is_completed_where_the_balances_tell(
    monkeypatch, left, hides, tried, slow, expected
):
    monkeypatch.setattr(forward_selection, "motion_is_hidden", lambda effects, fit: hides)
    monkeypatch.setattr(forward_selection, "complete", lambda *given: WHOLE)
    monkeypatch.setattr(forward_selection, "complete_by_simulation", lambda *given: SIMULATED)
    ledger = SimpleNamespace(
        fits={FINAL: fitted(left)}, output_error_fits={}, effects=lambda names: names,
        trials={FINAL: None} if tried else {}, study=SimpleNamespace(shows_accelerations=not slow),
    )  # fmt: skip
    levels = BalanceLevels(np.ones(3), np.full(3, 100.0))
    assert _completed(ledger, fitted(10.0), FINAL, levels) == expected


@pytest.mark.parametrize(
    ("left", "in_flow", "in_force"),
    [
        ([(8, 8), (4, 8), (4, 4), (4, 2)], 1, 2),
        ([(8, 8), (4, 4), (2, 2), (1, 1)], 3, 3),
        ([(8, 8), (7.9, 4)], 0, 1),
    ],
)
def test_effects_count_in_the_balances_that_they_act_in(monkeypatch, left, in_flow, in_force):
    monkeypatch.setattr(forward_selection, "residual_rms", lambda fitted: np.array(fitted.residual))
    fits = [
        SimpleNamespace(effects=("a", "b", "c")[:number], residual=residual)
        for number, residual in enumerate(left)
    ]
    counts = [acting_effects(fits, balance, CRITERIA.matters) for balance in (0, 1)]
    assert counts == [in_flow, in_force]


@pytest.mark.parametrize(
    ("residuals", "expected"),
    [
        # Three effects have left half of the gap in the force, in which one of them acts.
        ([10.0, 10.0, 10.0, 9.0], True),
        # Two have: a fourth would take up a part of a cause that is none of them.
        ([10.0, 10.0, 9.0, 8.0], False),
        # Nothing visible is left.
        ([1.7, 1.7, 1.7, 1.45], False),
        # A second effect is asked for by what it may gain.
        ([10.0, 4.0], True),
        ([10.0, 1.0], False),
    ],
)
def test_more_than_three_effects_are_selected_where_a_balance_was_not_searched(
    monkeypatch, residuals, expected
):
    names = [("a", "b", "c")[:number] for number in range(len(residuals))]
    fits = {key: fitted(left) for key, left in zip(names, residuals, strict=True)}
    for key, fit in fits.items():
        fit.effects = key
    ledger = SimpleNamespace(fits=fits)
    levels = BalanceLevels(np.ones(3), np.full(3, 100.0))
    assert _needs_more(ledger, fits[()], names[1:], levels) is expected


def test_a_pair_that_only_corrects_a_coarse_map_is_no_better_partner(monkeypatch):
    def is_coarse(ledger, current, known, key, levels):
        return "map" in key

    monkeypatch.setattr(forward_selection, "fit_extensions", lambda *given: None)
    monkeypatch.setattr(forward_selection, "accepted", lambda *given: True)
    monkeypatch.setattr(forward_selection, "_coarse", is_coarse)
    costs = {("hose",): 9.0, ("hose", "stribeck"): 5.0, ("hose", "map"): 1.0}
    fits = {key: SimpleNamespace(cost=cost) for key, cost in costs.items()}
    pair = ("hose", "stribeck")
    assert _backtrack(SimpleNamespace(fits=fits), None, pair, None, ("hose",)) == pair


@pytest.mark.parametrize(
    ("left", "gap_left", "expected"),
    [
        (2.0, {}, True),
        (6.0, {}, False),  # it will be `unknown`, whatever its effects contribute
        (6.0, {FINAL: 0.3}, True),  # simulations decide
    ],
)
def test_contributions_are_asked_of_models_that_may_be_named(left, gap_left, expected):
    ledger = SimpleNamespace(fits={FINAL: fitted(left)}, gap_left=gap_left)
    levels = BalanceLevels(np.ones(3), np.full(3, 100.0))
    assert _may_be_named(ledger, fitted(10.0), FINAL, levels) is expected
