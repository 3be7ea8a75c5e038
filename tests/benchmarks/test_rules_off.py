"""Rules are switched off one by one, noticed where they act, and scored by the draw."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger
from pneumo_casadi.evaluation.sealed_check.draw import Draw, Kind

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def rules(script):
    return script(BENCHMARKS / "rules_off.py")


#: Rules of the committed tables that have been taken away, and the number of draws at least.
GONE = {
    "rules_off": (
        50,
        {
            "pairs of the best effects",
            "contradicted shapes beside others",
            "unforeseen gains",
            "mean logarithms of blocks",
            "a weak effect for implausible parameters",
            "on while implausible",
        },
    ),
    "rules_off_rare": (
        200,
        {
            "begin with hidden motion",
            "nothing made implausible",
            "effects to which a term led",
            "one more after a term",
        },
    ),
}
LEAK = Draw("w001", Kind.SINGLE, 1, {"leakage_P": "large"}, background=("stribeck_gaussian",))
UNLISTED = Draw("w002", Kind.LEFT_OUT, 1, {"leakage_P": "large"})
NOTHING = Draw("w003", Kind.NONE, 1, {})
VALVE = Draw("w004", Kind.ABSORBED, 1, {"valve_mismatch": "large"})


@pytest.mark.parametrize(
    ("draw", "verdict", "names", "right"),
    [
        (LEAK, "effect", ["leakage_P"], True),
        (LEAK, "effect", ["leakage_P", "stribeck"], True),
        (LEAK, "effect", ["stribeck"], False),
        (LEAK, "effect", ["leakage_P", "hose"], False),
        (LEAK, "unknown", [], False),
        (UNLISTED, "unknown", [], True),
        (UNLISTED, "effect", ["leakage_N"], False),
        (UNLISTED, "none", [], False),
        (NOTHING, "none", [], True),
        (NOTHING, "unknown", [], False),
        (NOTHING, "FitError", [], False),
        (VALVE, "absorbed", ["valve_mismatch", "constant_force"], True),
        (VALVE, "absorbed", ["constant_force", "valve_mismatch"], False),
    ],
)
def test_a_verdict_is_right_by_the_causes_drawn(rules, draw, verdict, names, right):
    assert rules.right(draw, verdict, names) is right


def test_every_rule_stands_where_it_is_said_to_and_is_put_back(rules):
    at = {rule: rules._owner(rule) for rule in rules.RULES}
    usual = {rule: getattr(*place) for rule, place in at.items()}
    with rules.all_watched():
        assert all(getattr(*at[rule]) is not usual[rule] for rule in rules.RULES)
    for rule in rules.RULES:
        with rules.without(rules.move_of(rule)):
            assert getattr(*at[rule]) is rule.instead
        assert getattr(*at[rule]) is usual[rule]
    assert len({rule.does for rule in rules.RULES}) == len(rules.RULES)


@pytest.mark.parametrize("way", ["result", "state", "error", "nothing"])
def test_a_rule_is_noted_where_it_does_anything(rules, way):
    ledger = FitLedger(SimpleNamespace(), {})
    rule = rules.Rule("a rule", "nowhere", lambda ledger: None)

    def usual(ledger):
        if way == "error":
            raise ValueError
        if way == "state":
            ledger.fits["a",] = None
        return 1 if way == "result" else None

    noted = rules.criteria_moved.noted
    with noted() as near:
        if way == "error":
            with pytest.raises(ValueError):
                rules._watched(rule, usual)(ledger)
        else:
            rules._watched(rule, usual)(ledger)
    assert near == (set() if way == "nothing" else {rules.move_of(rule)})


@pytest.mark.parametrize("name", GONE)
def test_no_verdict_was_right_only_with_a_rule_that_is_gone(rules, name):
    draws, gone = GONE[name]
    committed = json.loads((BENCHMARKS / "results" / f"{name}.json").read_text("utf-8"))
    worse = {row["rule"]: row["worse_without"] for row in committed["rules"]}
    assert committed["cases"] >= draws and all(worse[rule] == [] for rule in gone)
    assert gone.isdisjoint(rule.does for rule in rules.RULES)
