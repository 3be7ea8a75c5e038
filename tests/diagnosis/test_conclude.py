"""A verdict is followed by what its kind asks for: a rival of what is named, or a term."""

from types import SimpleNamespace

import pytest

from pneumo_casadi.diagnosis import Verdict, conclude
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA


@pytest.fixture
def concluded(monkeypatch):
    """Conclude from a verdict of the balances, and from those of the review."""

    def run(balances, reviewed, rival=None, surpassed=Verdict.UNKNOWN):
        asked = []

        def decide(selection, checks, catalogue, surpassed=False):
            verdict = after if surpassed else reviewed
            judgement = SimpleNamespace(verdict=balances)
            named = verdict in (Verdict.EFFECT, Verdict.AMBIGUOUS)
            return SimpleNamespace(judgement=judgement, verdict=verdict, names_effects=named)

        after = surpassed
        monkeypatch.setattr(conclude, "check_fit", lambda *given: ["a check"])
        monkeypatch.setattr(conclude, "decide_verdict", decide)
        monkeypatch.setattr(conclude, "rather_one_cause", lambda *given: "")
        monkeypatch.setattr(
            conclude, "find_rival_term", lambda *given: asked.append("rival") or rival
        )
        monkeypatch.setattr(
            conclude, "discover_beside", lambda *given: asked.append("term") or "a term"
        )
        monkeypatch.setattr(conclude, "open_balances", lambda selection: (1,))
        axis = SimpleNamespace(outputs=(), equations=("mass_flow_P", "force"))
        study = SimpleNamespace(axis=axis, criteria=CRITERIA)
        selection = SimpleNamespace(chosen=("hose",), final=None, by_simulation=False)
        conclusion = conclude.conclude(study, selection, {"hose": SimpleNamespace}, None)
        assert conclusion.checks == ("a check",) and len(conclusion.effects) == 1
        # What is left besides is told of effects that are named, and of those alone.
        told = ["gap is left in force" in note for note in conclusion.notes]
        assert told == [True] * conclusion.decision.names_effects
        return conclusion.decision.verdict, conclusion.discovery, asked

    return run


@pytest.mark.parametrize(
    ("balances", "reviewed", "asked"),
    [
        (Verdict.EFFECT, Verdict.EFFECT, ["rival"]),
        (Verdict.AMBIGUOUS, Verdict.AMBIGUOUS, ["rival"]),
        (Verdict.EFFECT, Verdict.UNKNOWN, ["rival", "term"]),  # not credible
        (Verdict.UNKNOWN, Verdict.UNKNOWN, ["term"]),
        (Verdict.UNKNOWN, Verdict.ABSORBED, []),
        (Verdict.NONE, Verdict.NONE, []),
    ],
)
def test_a_term_is_looked_for_where_it_may_be_the_cause(concluded, balances, reviewed, asked):
    found = "a term" if "term" in asked else None
    assert concluded(balances, reviewed) == (reviewed, found, asked)


@pytest.mark.parametrize(
    ("surpassed", "shown"), [(Verdict.UNKNOWN, "a rival"), (Verdict.ABSORBED, None)]
)
def test_a_rival_of_what_is_named_makes_the_cause_unknown(concluded, surpassed, shown):
    result = concluded(Verdict.EFFECT, Verdict.EFFECT, rival="a rival", surpassed=surpassed)
    assert result == (surpassed, shown, ["rival"])
