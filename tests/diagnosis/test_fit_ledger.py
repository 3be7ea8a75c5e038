"""Fits of a model without one of its effects."""

from concurrent.futures import Future
from types import SimpleNamespace

import pytest

from pneumo_casadi.diagnosis.prepare.begun_jobs import BegunJobs
from pneumo_casadi.diagnosis.select import fit_ledger
from pneumo_casadi.diagnosis.select.fit_ledger import (
    MAX_ITERATIONS,
    SEARCH_ITERATIONS,
    FitLedger,
    Start,
)
from pneumo_casadi.errors import FitError

FINAL = ("hose", "leak")


@pytest.fixture
def ledger(monkeypatch):
    """A model of two effects; without the hose the leak is not credible, at `anyway` else."""
    monkeypatch.setattr(FitLedger, "__post_init__", lambda self: None)

    def made(anyway):
        kept = FitLedger(None, dict.fromkeys(FINAL))
        kept.effects = lambda names: kept.key(names)
        kept.fits[FINAL] = SimpleNamespace(values={"leak.size": 3.0})

        def run(job, effects, values, *others):
            done = Future()
            credible = others[-1] is not False
            if effects == ("leak",) and (credible or anyway is None):
                done.set_exception(FitError("leak.size = 900 is not credible"))
            else:
                cost = 5.0 if credible else anyway
                done.set_result(SimpleNamespace(cost=cost, values=values, pace=0.0))
            return done

        kept.run = run
        return kept

    return made


def test_a_model_that_is_not_credible_tells_what_is_missed_and_is_no_candidate(ledger):
    kept = ledger(anyway=70.0)
    fits = kept.fit_without(FINAL, FINAL)
    assert (fits["hose"].cost, fits["leak"].cost) == (70.0, 5.0)
    assert ("leak",) not in kept.fits and ("leak",) in kept.failures
    assert fits["hose"].values == {"leak.size": 3.0}  # it begins where the larger model ended


def test_where_there_is_no_fit_at_all_none_stands_for_it(ledger):
    fits = ledger(anyway=None).fit_without(FINAL, ("hose",))
    assert fits == {"hose": None}


@pytest.mark.parametrize(
    ("cost", "estimated", "kept_cost"),
    [
        pytest.param(900.0, (), 5.0, id="what was held is estimated as in the larger model"),
        pytest.param(3.0, (), 3.0, id="the better fit is kept"),
        pytest.param(900.0, ("leak.share",), 900.0, id="nothing was held"),
    ],
)
def test_a_model_compared_with_a_refined_one_is_estimated_alike(ledger, cost, estimated, kept_cost):
    """With a leak's viscous share held, a shifted null seems to gain what the share does."""
    kept = ledger(anyway=None)
    released = {"leak.size": 3.0, "leak.share": 0.9}
    whole = SimpleNamespace(values=released, std={"leak.share": 0.1, "leak.size": 0.1})
    std = dict.fromkeys(("leak.size", *estimated), 0.1)
    kept.fits["hose",] = SimpleNamespace(
        values={"leak.size": 1.0, "leak.share": 0.0}, std=std, cost=cost, pace=0.0
    )
    kept.fit_against(whole, {("hose",): Start(released)})
    assert kept.fits["hose",].cost == kept_cost


def ended(cost, pace=0.0, **values):
    """A fit that ended at a cost, cut short where it still gained something in each step."""
    return SimpleNamespace(cost=cost, pace=pace, values=values, std={})


@pytest.fixture
def ledger_of(monkeypatch):
    """Return a function that makes a ledger whose fits end so after so many iterations."""
    monkeypatch.setattr(FitLedger, "__post_init__", lambda self: None)

    def made(ends):
        kept = FitLedger(None, dict.fromkeys(("drag", "hose")))
        kept.effects = lambda names: kept.key(names)

        def run(job, effects, values, shapes, base, most, *others):
            done = Future()
            done.set_result(ends[effects, most])
            return done

        kept.run = run
        return kept

    return made


def test_a_fit_that_never_settles_must_be_credible_as_any(ledger_of, monkeypatch):
    def refuse(study, effects, fitted):
        raise FitError("not credible")

    monkeypatch.setattr(fit_ledger, "require_credible", refuse)
    drag = ("drag",)
    ends = {(drag, SEARCH_ITERATIONS): ended(9.0, 1.0), (drag, MAX_ITERATIONS): ended(5.0, 1.0)}
    kept = ledger_of(ends)
    kept.fit_all({drag: Start({})})
    assert drag in kept.failures and not kept.fits


@pytest.mark.parametrize("known", [False, True])
def test_models_without_an_effect_are_fitted_to_their_end(ledger_of, monkeypatch, known):
    """One cut short, now or while candidates were compared, would seem to lose more."""
    monkeypatch.setattr(fit_ledger, "require_credible", lambda *given: None)
    drag, hose = ("drag",), ("hose",)
    kept = ledger_of(
        {
            (drag, SEARCH_ITERATIONS): ended(5.0),
            (hose, SEARCH_ITERATIONS): ended(900.0, 1.0),
            (hose, MAX_ITERATIONS): ended(100.0),
        }
    )
    pair = ("drag", "hose")
    kept.fits[pair] = ended(0.0)
    if known:
        kept.fits[hose] = ended(900.0, 1.0)
    fits = kept.fit_without(pair, pair)
    assert (fits["drag"].cost, fits["hose"].cost) == (100.0, 5.0)


@pytest.fixture
def working(monkeypatch):
    """A ledger with an executor, and the keys of the fits that it has begun."""
    monkeypatch.setattr(FitLedger, "__post_init__", lambda self: None)
    kept, begun = FitLedger(None, dict.fromkeys(("drag", "hose")), executor=object()), []
    kept.effects = lambda names: kept.key(names)

    def run(job, effects, values, *others):
        begun.append(effects)
        done = Future()
        done.set_result(ended(values["cost"]))
        return done

    kept.run = run
    return kept, begun


DRAG, START = ("drag",), Start({"cost": 5.0})


def test_a_fit_that_was_begun_counts_once_it_is_asked_for(working):
    kept, begun = working
    kept.begin_fit(DRAG, START)
    assert kept.fits == {} and begun == [DRAG]
    kept.fit_all({DRAG: Start({"cost": 5.0})})  # from equal values
    assert kept.fits[DRAG].cost == 5.0 and begun == [DRAG]


def test_a_fit_begun_elsewhere_than_where_it_is_to_begin_is_none(working):
    kept, begun = working
    kept.begin_fit(DRAG, START)
    kept.fit_all({DRAG: Start({"cost": 7.0})})
    assert kept.fits[DRAG].cost == 7.0 and begun == [DRAG, DRAG]


@pytest.mark.parametrize("known", ["fits", "failures", "nowhere to run", "kept on disk"])
def test_nothing_is_begun_that_is_known_or_that_would_have_to_be_waited_for(working, known):
    kept, begun = working
    if known == "nowhere to run":
        kept.executor = None
    elif known == "kept on disk":  # whose files are those of fits that were asked for
        kept.store = object()
    else:
        getattr(kept, known)[DRAG] = None
    kept.begin_fit(DRAG, START)
    assert begun == []


def test_what_nobody_asked_for_is_cancelled():
    begun, waiting, asked = BegunJobs(), Future(), Future()
    begun.add("waiting", 1, waiting)
    begun.add("asked", 2, asked)
    assert begun.take("asked", 2) is asked and "asked" not in begun
    begun.cancel_all()
    assert waiting.cancelled() and not asked.cancelled()
