"""Effects to which a term has led take the place of a selection that went astray."""

from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis import Verdict, conclude
from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA
from pneumo_casadi.diagnosis.select import reselect as module
from pneumo_casadi.diagnosis.select.complete import Completed
from pneumo_casadi.diagnosis.select.fit_ledger import Failed, FitLedger
from pneumo_casadi.diagnosis.select.forward_selection import Selection

LEVELS = BalanceLevels(np.ones(3), np.full(3, 100.0))
PAIR = ("heat_transfer", "supply_droop")
WHOLE = Completed((*PAIR, "leakage_P"), PAIR)


def selection(*chosen):
    fits = {("position_delay",): "late"}
    return Selection("nominal", fits, (), {}, (chosen,), LEVELS, {}, {}, {}, None)


@pytest.fixture
def reselected(monkeypatch):
    """Return a function that reselects a pair which leaves so many floors in its worst balance."""

    def run(left, hides=False, before=("position_delay",), fails=False, failures=None):
        def complete(*given):
            if fails:
                raise ArithmeticError
            return WHOLE

        monkeypatch.setattr(module, "residual_rms", lambda fitted: np.array([1.0, 1.1, fitted]))
        monkeypatch.setattr(module, "motion_is_hidden", lambda effects, fitted: hides)
        monkeypatch.setattr(module, "complete", complete)
        monkeypatch.setattr(module, "contributions", lambda *given: {"heat_transfer": 0.6})
        ledger = SimpleNamespace(
            fits={PAIR: left}, effects=lambda names: names, failures=failures or {}
        )
        return module.reselect(ledger, selection(*before), PAIR)

    return run


def test_effects_that_leave_no_visible_gap_end_the_selection(reselected):
    other = reselected(1.4)
    assert (other.accepted, other.chosen, other.named) == (PAIR, WHOLE.acting, PAIR)
    assert other.contributions == {"heat_transfer": 0.6}
    assert set(other.fits) == {PAIR, ("position_delay",)}


@pytest.mark.parametrize(
    "given",
    [
        {"left": 1.6},  # a gap that would be visible
        {"left": 1.0, "hides": True},  # balances do not tell
        {"left": 1.0, "before": PAIR},  # nothing new
        {"left": 1.0, "fails": True},
    ],
)
def test_others_do_not(reselected, given):
    assert reselected(**given) is None


def test_fits_that_failed_beside_a_term_are_told(reselected):
    """Whoever reads of them must not take them for tried and worse."""
    failed = Failed(("hose", "leakage_P"), "not credible")
    later = Failed(PAIR, "not credible")  # it was fitted after all
    failures = {each.effects: each for each in (failed, later)}
    assert reselected(1.0, failures=failures).failures == (failed,)


THREE = ("position_friction", "quadratic_drag", "valve_hysteresis")


@pytest.mark.parametrize(
    ("names", "left", "taken"),
    [
        (THREE, {"spring_load": (900.0, 1.2), "stribeck": (200.0, 1.0)}, "spring_load"),
        (THREE, {"spring_load": (900.0, 1.7), "stribeck": (200.0, 1.0)}, None),  # the best counts
        (THREE, {}, None),
        (THREE[:2], {"spring_load": (900.0, 1.2)}, None),  # the search has looked there itself
    ],
)
def test_one_effect_more_is_tried_where_the_search_had_stopped(monkeypatch, names, left, taken):
    """A weak spring beside three others had come out as a term, a line over x."""
    ledger = SimpleNamespace(
        fits={names: SimpleNamespace(cost=0.0, left=5.0)}, effects=lambda names: names, failures={}
    )

    def extend(ledger, nominal, current, known, levels):
        for name, (gain, floors) in left.items():
            key = tuple(sorted((*known, name)))
            ledger.fits[key] = SimpleNamespace(cost=-gain, left=floors)

    ledger.extensions = lambda known: FitLedger.extensions(ledger, known)
    monkeypatch.setattr(module, "fit_extensions", extend)
    monkeypatch.setattr(module, "residual_rms", lambda fit: np.array([1.0, 1.0, fit.left]))
    monkeypatch.setattr(module, "motion_is_hidden", lambda *given: False)
    monkeypatch.setattr(module, "complete", lambda *given: Completed(given[2], given[2]))
    monkeypatch.setattr(module, "contributions", lambda *given: {})
    result = module.reselect_further(ledger, selection(*names), names)
    assert (result and result.chosen) == (tuple(sorted((*names, taken))) if taken else None)


@pytest.mark.parametrize(("named", "taken"), [(True, True), (False, False)])
def test_they_stand_for_it_only_where_they_are_named(monkeypatch, named, taken):
    instead = selection(*PAIR)
    first = SimpleNamespace(
        judgement=SimpleNamespace(verdict=Verdict.UNKNOWN),
        verdict=Verdict.UNKNOWN,
        names_effects=False,
    )
    decisions = {("position_delay",): first, PAIR: SimpleNamespace(names_effects=named)}
    monkeypatch.setattr(conclude, "check_fit", lambda *given: ())
    monkeypatch.setattr(
        conclude, "decide_verdict", lambda chosen, *given, surpassed: decisions[chosen.chosen]
    )
    monkeypatch.setattr(conclude, "discover_beside", lambda *given: ("a term", instead))
    monkeypatch.setattr(conclude, "rather_one_cause", lambda *given: "")
    monkeypatch.setattr(Selection, "final", None)
    study = SimpleNamespace(axis=SimpleNamespace(outputs=()), criteria=CRITERIA)
    catalogue = dict.fromkeys((*PAIR, "position_delay"), SimpleNamespace)
    conclusion = conclude.conclude(study, selection("position_delay"), catalogue, None)
    assert (conclusion.selection is instead) is taken
    assert conclusion.discovery == (None if taken else "a term")
