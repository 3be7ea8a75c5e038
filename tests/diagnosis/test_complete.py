"""The final model takes up what the likelihood asks for, and drops what it need not."""

from concurrent.futures import Future
from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA
from pneumo_casadi.diagnosis.select import complete as stage
from pneumo_casadi.diagnosis.select import neighbours
from pneumo_casadi.diagnosis.select.complete import Completed, complete, find_acting
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger
from pneumo_casadi.effects import EFFECTS

LEVELS = SimpleNamespace(criteria=CRITERIA)
#: What the screen promises of an effect beside others, over what it gains.
OPTIMISM = 1.1


@dataclass(frozen=True)
class Model:
    """What of a fit counts here."""

    effects: tuple
    cost: float
    on_all: float
    values: dict = field(default_factory=dict)
    pace: float = 0.0


class Bench:
    """A ledger whose models gain what a table says, on the records fitted and on all.

    Parameters
    ----------
    gains : mapping of tuple of str to float
        Log-likelihood of a model over the nominal one; of others it is the sum of `alone`.
    alone : mapping of str to float
        Of each effect.
    held_out : mapping of str to float
        What an effect gains on all records, where that differs.
    """

    def __init__(self, monkeypatch, alone, gains=None, held_out=None, large=("hose",)):
        monkeypatch.setattr(FitLedger, "__post_init__", lambda self: None)
        self.alone, self.held_out = alone, held_out or {}
        self.gains = {frozenset(names): gain for names, gain in (gains or {}).items()}
        self.ledger = FitLedger(
            SimpleNamespace(criteria=CRITERIA), {name: lambda name=name: name for name in alone}
        )
        self.refused, self.large, self.asked = set(), set(large), []
        self.refined, self.needed, self.map_only, self.cannot = [], set(), set(), False
        self.incredible, self.unsure = set(), set()
        monkeypatch.setattr(neighbours, "hides", lambda effect, values: effect == "play")
        self.ledger.effects = lambda names: tuple(names)
        monkeypatch.setattr(
            neighbours.Neighbours,
            "estimated",  # one parameter of each effect, two where a name says so
            lambda near, names: sum(1 + ("of_two" in name) for name in names),
        )
        self.ledger.fit_all = self.fit_all
        self.ledger.fit_without = self.fit_without
        self.ledger.refine = self.refined.append
        self.ledger.over = self.over
        monkeypatch.setattr(
            neighbours, "background", lambda study, nominal, fitted, effects: fitted
        )
        monkeypatch.setattr(
            neighbours,
            "lost_likelihood",
            lambda whole, without: self.gain(whole.effects) - self.gain(without.effects),
        )
        monkeypatch.setattr(stage, "accepted", self.accepted)
        monkeypatch.setattr(stage, "surely_gains", self.surely_gains)
        monkeypatch.setattr(
            stage,
            "only_corrects_map",
            lambda added, *given, beside: set(added) <= self.map_only,
        )
        monkeypatch.setattr(
            neighbours, "gain_on_all_records", lambda before, after: after.on_all - before.on_all
        )
        self.nominal = self.model(())

    def model(self, names):
        gain = self.gain(names)
        extra = sum(self.held_out.get(n, self.alone[n]) - self.alone[n] for n in names)
        return Model(tuple(names), -gain, gain + extra)

    def gain(self, names):
        return self.gains.get(frozenset(names), sum(self.alone[name] for name in names))

    def fit_all(self, starts, to_end=False):
        for key in starts:
            self.asked.append(key)
            refused = set(key) & self.refused or not self.needed <= set(key)
            if refused or key in self.incredible:
                self.ledger.failures[key] = None
            else:
                self.ledger.fits.setdefault(key, self.model(key))

    def fit_without(self, names, some):
        keys = {name: self.ledger.key(set(names) - {name}) for name in some}
        self.fit_all(dict.fromkeys(keys.values()))
        fits = {name: self.ledger.fits.get(key) for name, key in keys.items()}
        return {
            name: self.model(keys[name]) if fit is None and not self.cannot else fit
            for name, fit in fits.items()
        }

    def over(self, behind, without):
        promised = {
            name: SimpleNamespace(
                name=name,
                gain=OPTIMISM * (self.gain({*behind.effects, name}) - self.gain(behind.effects)),
                sizes={}, starts=(),
            )
            for name in self.alone
            if name not in without
        }  # fmt: skip
        return dict(sorted(promised.items(), key=lambda item: -item[1].gain))

    def accepted(self, origin, before, after, levels):
        (added,) = set(after.effects) - set(before.effects)
        return added in self.large

    def surely_gains(self, before, after, levels):
        (added,) = set(after.effects) - set(before.effects)
        return added not in self.unsure

    def complete(self, *final):
        self.fit_all({self.ledger.key(final): None})
        return complete(self.ledger, self.nominal, self.ledger.key(final), LEVELS)


ALONE = {"hose": 900.0, "leak": 150.0, "lag": 120.0, "drag": 90.0, "play": 500.0}


def test_weak_effects_join_the_model_and_only_large_ones_are_named(monkeypatch):
    bench = Bench(monkeypatch, ALONE)
    # A drag of less than `plausible_gain` stays out, and so does what hides the motion.
    assert bench.complete("hose") == Completed(("hose", "leak", "lag"), ("hose",))


def test_what_records_held_out_do_not_show_stays_out(monkeypatch):
    bench = Bench(monkeypatch, ALONE, held_out={"leak": 90.0})
    assert bench.complete("hose") == Completed(("hose", "lag"), ("hose",))


def test_what_held_out_records_do_not_surely_ask_for_stays_and_is_not_told(monkeypatch):
    bench = Bench(monkeypatch, ALONE)
    bench.unsure = {"leak", "hose"}  # what is large enough to be named has been asked more
    assert bench.complete("hose") == Completed(("hose", "leak", "lag"), ("hose",), ("leak",))


def test_one_effect_that_stands_for_others_is_dropped_once_they_are_there(monkeypatch):
    alone = {"shift": 0.0, "leak": 0.0, "lag": 120.0}
    gains = {
        ("shift",): 800.0, ("leak",): 700.0, ("lag",): 120.0,
        ("shift", "lag"): 950.0, ("leak", "lag"): 1500.0, ("shift", "leak"): 900.0,
        ("shift", "leak", "lag"): 1520.0,
    }  # fmt: skip
    bench = Bench(monkeypatch, alone, gains, large=("leak",))
    assert bench.complete("shift") == Completed(("leak", "lag"), ("leak",))


def test_an_effect_is_exchanged_where_another_one_gains_more_beside_the_others(monkeypatch):
    alone = {"shift": 0.0, "leak": 0.0, "lag": 0.0}
    gains = {
        (): 0.0, ("shift",): 800.0, ("leak",): 700.0, ("lag",): 120.0, ("shift", "lag"): 950.0,
        ("leak", "lag"): 1000.0, ("shift", "leak"): 850.0, ("shift", "leak", "lag"): 1040.0,
    }  # fmt: skip
    bench = Bench(monkeypatch, alone, gains, large=("leak", "shift"))
    assert bench.complete("shift") == Completed(("leak", "lag"), ("leak",))


def test_where_an_effect_is_required_the_search_ends_without_it(monkeypatch):
    alone = {"shift": 0.0, "leak": 0.0, "lag": 0.0, "drag": 0.0}
    gains = {
        (): 0.0, ("shift",): 800.0, ("leak",): 700.0, ("lag",): 120.0, ("shift", "lag"): 950.0,
        ("leak", "lag"): 1000.0, ("shift", "leak"): 850.0, ("shift", "leak", "lag"): 1040.0,
        ("leak", "lag", "drag"): 1400.0,
    }  # fmt: skip
    bench = Bench(monkeypatch, alone, gains)
    bench.fit_all({("shift",): None})
    given = bench.ledger, bench.nominal, ("shift",), LEVELS
    assert find_acting(*given, {"shift"}.issubset) == ("leak", "lag")
    assert ("leak", "lag", "drag") not in bench.asked and bench.refined == []
    assert find_acting(*given) == ("leak", "lag", "drag")


def test_of_a_model_that_is_of_no_use_no_effect_is_named(monkeypatch):
    bench = Bench(monkeypatch, ALONE)
    bench.fit_all({("hose",): None})
    given = bench.ledger, bench.nominal, ("hose",), LEVELS
    assert complete(*given, lambda names: False) == Completed(("hose", "leak", "lag"), ())
    assert bench.refined == []


def test_what_was_begun_for_a_model_that_is_left_behind_is_cancelled(monkeypatch):
    bench = Bench(monkeypatch, {"shift": 800.0, "leak": 700.0, "lag": 120.0})
    begun = Future()
    bench.ledger.begun_fits.add(("leak", "lag"), None, begun)
    bench.complete("shift", "leak")
    assert begun.cancelled()


def test_an_effect_that_stands_for_two_others_is_exchanged_for_both(monkeypatch):
    """A shifted null does in both chambers what a leak does in each."""
    alone = {"hose": 900.0, "shift": 0.0, "leak_P": 0.0, "leak_N": 0.0}
    both = {
        (): 0.0, ("shift",): 800.0, ("leak_P",): 600.0, ("leak_N",): 200.0,
        ("shift", "leak_P"): 810.0, ("shift", "leak_N"): 810.0, ("leak_P", "leak_N"): 920.0,
        ("shift", "leak_P", "leak_N"): 925.0,
    }  # fmt: skip
    gains = {("hose", *names): 900.0 + gain for names, gain in both.items()}
    bench = Bench(monkeypatch, alone, gains)
    assert bench.complete("hose", "shift").acting == ("hose", "leak_P", "leak_N")
    gains["hose", "leak_P", "leak_N"] -= 30.0  # gain less than an effect more must
    bench = Bench(monkeypatch, alone, gains)
    assert bench.complete("hose", "shift").acting == ("hose", "shift")


@pytest.mark.parametrize(
    ("more", "expected"),
    [(25.0, ("hose", "leak_P", "leak_N")), (15.0, ("hose", "shift_of_two"))],
)
def test_two_effects_of_one_parameter_each_replace_one_of_two_for_less(monkeypatch, more, expected):
    alone = {"hose": 900.0, "shift_of_two": 0.0, "leak_P": 0.0, "leak_N": 0.0, "lag": 0.0}
    both = {
        (): 0.0, ("shift_of_two",): 800.0, ("leak_P",): 600.0, ("leak_N",): 200.0, ("lag",): 0.0,
        ("shift_of_two", "leak_P"): 805.0, ("shift_of_two", "leak_N"): 805.0,
        ("shift_of_two", "lag"): 805.0,
        # What promises most beside the first leak is not what gains most: both are compared.
        ("leak_P", "lag"): 800.0 + more - 1.0, ("leak_P", "leak_N"): 800.0 + more,
        ("leak_P", "leak_N", "lag"): 805.0 + more,
    }  # fmt: skip
    gains = {("hose", *names): 900.0 + gain for names, gain in both.items()}
    bench = Bench(monkeypatch, alone, gains)
    assert bench.complete("hose", "shift_of_two").acting == expected


def test_a_pair_of_which_a_review_would_drop_one_replaces_nothing(monkeypatch):
    alone = {"hose": 900.0, "shift_of_two": 0.0, "leak_P": 0.0, "leak_N": 0.0}
    both = {
        (): 0.0, ("shift_of_two",): 800.0, ("leak_P",): 765.0, ("leak_N",): 200.0,
        ("shift_of_two", "leak_P"): 805.0, ("shift_of_two", "leak_N"): 805.0,
        ("leak_P", "leak_N"): 825.0, ("shift_of_two", "leak_P", "leak_N"): 830.0,
    }  # fmt: skip
    gains = {("hose", *names): 900.0 + gain for names, gain in both.items()}
    bench = Bench(monkeypatch, alone, gains)
    assert bench.complete("hose", "shift_of_two").acting == ("hose", "shift_of_two")


@pytest.mark.parametrize(
    ("names", "estimated"),
    [(("valve_null_shift",), 2), (("leakage_N", "leakage_P"), 2), (("valve_stiction",), 3)],
)
def test_parameters_that_every_fit_estimates_are_counted_scans_included(
    monkeypatch, names, estimated
):
    monkeypatch.setattr(FitLedger, "__post_init__", lambda self: None)
    ledger = FitLedger(SimpleNamespace(criteria=CRITERIA), EFFECTS)
    assert neighbours.Neighbours(ledger, None).estimated(names) == estimated


def test_what_is_large_enough_to_be_named_is_not_dropped_for_little_likelihood(monkeypatch):
    bench = Bench(monkeypatch, ALONE, large=("hose", "drag"))
    assert bench.complete("hose", "drag").named == ("hose", "drag")
    small = Bench(monkeypatch, ALONE)
    assert "drag" not in small.complete("hose", "drag").acting


def test_the_two_that_promise_most_begin_together(monkeypatch):
    bench = Bench(monkeypatch, {"hose": 900.0, "leak": 300.0, "lag": 120.0, "drag": 90.0})
    begun = []
    monkeypatch.setattr(FitLedger, "begin_fit", lambda self, key, start: begun.append(key))
    assert bench.complete("hose").acting == ("hose", "leak", "lag")
    assert begun[:2] == [("hose", "leak"), ("hose", "lag")]


def test_what_may_stand_for_the_next_effect_begins_while_one_is_looked_at(monkeypatch):
    """So that no process waits: the fits of both begin before those of the first are asked for."""
    alone = {"shift": 0.0, "leak": 0.0, "lag": 0.0}
    gains = {
        (): 0.0, ("shift",): 700.0, ("leak",): 690.0, ("lag",): 695.0, ("shift", "leak"): 1400.0,
        ("shift", "lag"): 1390.0, ("leak", "lag"): 1385.0, ("shift", "leak", "lag"): 1405.0,
    }  # fmt: skip
    bench = Bench(monkeypatch, alone, gains)
    monkeypatch.setattr(FitLedger, "begins_ahead", True)
    order = []
    monkeypatch.setattr(
        FitLedger, "begin_fit", lambda self, key, start: order.append(("begun", key))
    )
    before = bench.ledger.fit_all
    bench.ledger.fit_all = lambda starts, to_end=False: (
        order.extend(("asked", key) for key in starts),
        before(starts, to_end),
    )
    assert bench.complete("shift", "leak").acting == ("shift", "leak")
    exchanges = [step for step in order if step[1] in {("shift", "lag"), ("leak", "lag")}]
    assert [step for step, _ in exchanges[:2]] == ["begun", "begun"]


def test_an_effect_that_is_not_credible_is_tried_once(monkeypatch):
    bench = Bench(monkeypatch, ALONE)
    bench.refused = {"leak"}
    assert bench.complete("hose").acting == ("hose", "lag")
    assert sum("leak" in key for key in bench.asked) == 1


def test_an_effect_without_which_the_model_cannot_be_fitted_is_named(monkeypatch):
    bench = Bench(monkeypatch, ALONE, large=())
    bench.needed, bench.cannot = {"hose"}, True
    assert bench.complete("hose", "leak") == Completed(("hose", "leak", "lag"), ("hose",))


@pytest.mark.parametrize(
    ("selected", "large", "named"),
    [
        (("hose", "leak"), ("hose",), ("hose", "leak")),
        # Added for its likelihood alone: what is missed at least decides.
        (("hose",), ("hose",), ("hose",)),
        (("hose",), ("hose", "leak"), ("hose", "leak")),
    ],
)
def test_a_selected_effect_is_named_if_without_it_the_model_is_not_credible(
    monkeypatch, selected, large, named
):
    bench = Bench(monkeypatch, ALONE, large=large)
    bench.incredible = {("hose", "lag")}
    assert bench.complete(*selected) == Completed(("hose", "leak", "lag"), named)


def test_an_effect_of_no_size_that_keeps_a_model_credible_is_not_named(monkeypatch):
    bench = Bench(monkeypatch, ALONE | {"leak": 5.0})
    bench.incredible = {("hose", "lag")}
    assert bench.complete("hose", "leak") == Completed(
        ("hose", "leak", "lag"), ("hose",), ("leak",)
    )


def test_what_only_corrects_a_coarse_map_is_not_named(monkeypatch):
    bench = Bench(monkeypatch, ALONE, large=("hose", "leak"))
    bench.map_only = {"leak"}
    assert bench.complete("hose") == Completed(("hose", "leak", "lag"), ("hose",))


def test_the_final_model_goes_on_to_its_minimum(monkeypatch):
    bench = Bench(monkeypatch, ALONE)
    assert bench.refined == [] and bench.complete("hose").acting == bench.refined[0]


def test_what_a_needless_effect_has_kept_out_joins_in_a_second_round(monkeypatch):
    alone = {"hose": 900.0, "shift": 0.0, "leak": 0.0, "lag": 0.0}
    gains = {
        ("hose", *names): 900.0 + gain
        for names, gain in {
            ("shift",): 150.0, ("leak",): 140.0, ("lag",): 10.0, ("shift", "leak"): 300.0,
            ("shift", "lag"): 160.0, ("leak", "lag"): 400.0, ("shift", "leak", "lag"): 405.0,
        }.items()
    }  # fmt: skip
    bench = Bench(monkeypatch, alone, gains)
    assert bench.complete("hose").acting == ("hose", "leak", "lag")


def test_an_exchange_must_promise_most_of_what_would_be_lost(monkeypatch):
    bench = Bench(monkeypatch, {"hose": 900.0, "drag": 50.0, "leak": 60.0})
    bench.complete("hose")
    assert ("drag",) not in bench.asked and ("leak",) not in bench.asked


def test_where_no_effect_is_large_by_itself_the_one_that_is_most_is_named(monkeypatch):
    assert Bench(monkeypatch, ALONE, large=()).complete("hose").named == ("hose",)


@pytest.mark.parametrize("weak", [3, 12])
def test_a_model_gets_no_more_effects_than_it_may_have(monkeypatch, weak):
    alone = {"hose": 900.0} | {f"leak{i}": 150.0 for i in range(weak)}
    assert len(Bench(monkeypatch, alone).complete("hose").acting) == min(1 + weak, stage.MAX_ACTING)
