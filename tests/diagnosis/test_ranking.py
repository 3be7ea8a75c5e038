"""The ranking shows models by what they name."""

from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis.decide import ranking
from pneumo_casadi.diagnosis.decide.judgement import Judgement
from pneumo_casadi.diagnosis.decide.ranking import rank_candidates, unnamed_effects
from pneumo_casadi.diagnosis.metrics.findings import EffectFound, Value
from pneumo_casadi.diagnosis.metrics.verdict import Verdict
from pneumo_casadi.diagnosis.select.complete import Completed
from pneumo_casadi.diagnosis.select.fit_ledger import Failed
from pneumo_casadi.diagnosis.select.selection import Selection
from pneumo_casadi.effects import EFFECTS

BEST, OTHER, RIVAL = ("hose", "stribeck"), ("leakage_N", "stribeck"), ("hose", "presliding")
PROBABILITY = {BEST: 0.3, OTHER: 0.2, RIVAL: 0.35, ("stribeck",): 0.0}


@pytest.fixture
def ranked(monkeypatch):
    """Stribeck friction is named, a hose acts besides; of two more models one has another cause."""
    return made_ranking(monkeypatch, PROBABILITY)


def made_ranking(monkeypatch, probability, hidden=(), failures=()):
    monkeypatch.setattr(ranking, "balance_closure", lambda nominal, fitted, levels: fitted.closes)
    monkeypatch.setattr(
        ranking,
        "_own",
        lambda study, fitted, names, catalogue: {f"{n}.size": Value(1.0, 0.1, "N") for n in names},
    )
    fits = {key: SimpleNamespace(cost=1.0, closes=sum(map(len, key))) for key in probability}
    screen = {
        name: SimpleNamespace(explained=share, observable=share)
        for name, share in {
            "hose": 0.1,
            "stribeck": 0.8,
            "presliding": 0.7,
            "leakage_N": 0.2,
        }.items()
    }
    selection = Selection(
        None, fits, failures, screen, (("stribeck",),), None, {}, {}, {}, None,
        completed=Completed(BEST, ("stribeck",)),
    )  # fmt: skip
    judgement = Judgement(Verdict.EFFECT, (), probability, 0.0, np.ones(3), np.zeros(3))
    return rank_candidates(None, selection, judgement, hidden, EFFECTS)


def test_models_that_differ_in_weak_effects_are_one_candidate(ranked):
    fitted = [candidate.names for candidate in ranked if candidate.closure is not None]
    assert fitted == [("presliding",), ("stribeck",), ("leakage_N", "stribeck")]


def test_the_most_probable_is_first_by_the_sum_of_its_models(ranked):
    odds = [candidate.probability for candidate in ranked]
    assert odds == sorted(odds, reverse=True)
    assert sum(odds) == pytest.approx(sum(PROBABILITY.values()))


def test_a_candidate_shows_what_it_names_alone(ranked):
    (named,) = [candidate for candidate in ranked if candidate.names == ("stribeck",)]
    assert (named.explained, named.observable) == (0.8, 0.8)
    assert list(named.parameters) == ["size"]
    assert named.closure == sum(map(len, BEST))  # of the most probable of its models


def test_forms_of_the_same_cause_are_one_candidate(monkeypatch):
    """The most probable form is shown, with the probability of all."""
    forms = {BEST: 0.2, ("hose_volume", "stribeck"): 0.3, ("hose_volume",): 0.1, ("hose",): 0.25}
    ranked = made_ranking(monkeypatch, forms | {("stribeck",): 0.15})
    names = [frozenset(candidate.names) for candidate in ranked]
    assert len(names) == len(set(names))
    by_causes = {candidate.names: candidate for candidate in ranked}
    assert by_causes["hose",].probability == pytest.approx(0.35)
    assert by_causes["hose", "stribeck"].probability == pytest.approx(0.3)


def test_what_parameters_absorb_stands_once_whatever_its_forms(monkeypatch):
    ranked = made_ranking(monkeypatch, PROBABILITY | {("hose_volume",): 0.15}, ("hose",))
    assert [candidate.names for candidate in ranked].count(("hose",)) == 1
    assert ranked[0].names == ("hose",) and ranked[0].probability == pytest.approx(0.8)


def test_fits_that_failed_stand_with_their_reason(monkeypatch):
    """Another form of the same cause that was not fitted does not stand in their place."""
    failures = (Failed(("leakage_P",), "C is not credible"), Failed(("hose_volume",), "V as well"))
    ranked = made_ranking(monkeypatch, PROBABILITY, failures=failures)
    told = {candidate.names: candidate.failure for candidate in ranked if candidate.failure}
    assert told == {("leakage_P",): "C is not credible", ("hose",): "V as well"}
    assert [candidate.names for candidate in ranked].count(("leakage_P",)) == 1


def test_the_form_of_the_verdict_is_shown_before_a_more_probable_one(monkeypatch):
    forms = {BEST: 0.2, ("hose", "stribeck_rational"): 0.5, ("stribeck",): 0.0}
    first = made_ranking(monkeypatch, forms)[0]
    assert first.names == ("stribeck",) and first.probability == pytest.approx(0.7)
    assert first.closure == sum(map(len, BEST))


def test_what_corrects_the_flow_map_is_not_told_as_probably_there():
    effects = [EffectFound(name, 0.9, {}) for name in ("stribeck", "flow_map_shape", "hose")]
    effects.append(EffectFound("leakage_P", 0.9, {}))
    besides = ("flow_map_shape", "hose", "leakage_P")
    selection = SimpleNamespace(besides=besides, idle=("flow_map_shape", "leakage_P"))
    kinds = unnamed_effects(effects, selection, EFFECTS)
    assert {kind: [effect.name for effect in members] for kind, members in kinds.items()} == {
        "besides": ["hose"],
        "corrections": ["flow_map_shape"],  # idle or not
        "unsupported": ["leakage_P"],
    }
