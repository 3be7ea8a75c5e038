"""A moved criterion is noted wherever it would decide otherwise, and shared fits stay right."""

import json
import sys
from concurrent.futures import Future
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA
from pneumo_casadi.diagnosis.prepare.study_jobs import _run_in_worker

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def moved(script):
    return script(BENCHMARKS / "criteria_moved.py")


@pytest.fixture(scope="module")
def shared_fits(script, moved):
    return sys.modules["shared_fits"]


@pytest.fixture
def half(moved):
    """Return a half that may be 0.4 or 0.6."""
    low, high = moved.Move("share", 0.4), moved.Move("share", 0.6)
    return moved.Movable(0.5, {low: 0.4, high: 0.6}), low, high


@pytest.mark.parametrize(
    ("compare", "expected", "lower", "higher"),
    [
        (lambda half: np.float64(0.45) > half, False, True, False),
        (lambda half: half < np.float64(0.55), True, False, True),
        (lambda half: 2 * half - 0.1 >= 0.95, False, False, True),
        (lambda half: 1 / half < 1.9, False, False, True),
        (lambda half: -half < -0.45, True, True, False),
        (lambda half: np.any(np.array([0.1, 0.45]) > half), False, True, False),
        (lambda half: np.any(np.array([0.1, 0.45]) * half > 0.3), False, False, False),
        (lambda half: np.sqrt(half) > 0.75, False, False, True),
        (lambda half: np.where([True, False], half, 9.0)[0] > 0.55, False, False, True),
        (lambda half: np.maximum(half, [0.3, 0.45])[1] > 0.47, True, True, False),
        (lambda half: max(half, 0.55) > 1.0, False, False, True),
        (lambda half: (half * np.ones(2)).max() > 0.7, False, False, False),
        (lambda half: bool(half), True, True, True),
        (lambda half: float(half) > 2.0, False, True, True),
        (lambda half: np.asarray(half).size > 1, False, True, True),
    ],
)
def test_a_comparison_notes_the_moves_that_change_it(moved, half, compare, expected, lower, higher):
    value, low, high = half
    with moved.noted() as moves:
        outcome = compare(value)
    assert bool(outcome) is expected
    assert moves == {move for move, hit in ((low, lower), (high, higher)) if hit}


def test_an_array_that_holds_plain_numbers_takes_no_movable_one(half):
    value, _, _ = half
    with pytest.raises(TypeError, match="write it as a term"):
        np.multiply(value, np.ones(2), out=np.ones(2))


@pytest.mark.parametrize("name", asdict(CRITERIA))
def test_a_criterion_is_moved_down_and_up_and_probabilities_stay_below_one(moved, name):
    value = getattr(CRITERIA, name)
    lowered, raised = (move.value for move in moved.moves_of(name))
    if name in moved.PROBABILITIES:
        assert lowered < value < raised < 1
    else:
        assert (lowered, raised) == pytest.approx((0.8 * value, 1.2 * value))
    assert set(moved.moves_of(name)) <= set(moved.moves())


def submit(fits, job, *given):
    return fits.submit(_run_in_worker, b"", job, *given)


def test_a_fit_is_shared_unless_the_move_would_change_a_comparison_in_it(moved, shared_fits, half):
    value, low, high = half
    calls = []

    def job(study, limit):
        calls.append(limit)
        return study["share"] < limit

    fits = shared_fits.SharedFits()
    fits.study = {"share": value}
    with moved.noted() as near:
        assert submit(fits, job, 0.45).result() is np.False_
    assert near == {low}
    fits.study, fits.move = {"share": 0.6}, high
    assert not submit(fits, job, 0.45).result() and len(calls) == 1
    fits.study, fits.move = {"share": 0.4}, low
    assert submit(fits, job, 0.45).result() and len(calls) == 2
    assert submit(fits, job, 0.45).result() and len(calls) == 2  # once for the move, too
    assert not submit(fits, job, 0.3).result() and len(calls) == 3  # another fit


def test_other_jobs_are_shared_by_content_unless_the_move_would_change_them(
    moved, shared_fits, half
):
    value, low, high = half
    calls = []

    def job(levels, start, foreign=False):
        calls.append(start)
        return levels.criteria.share < 0.55

    def levels(share):
        criteria = SimpleNamespace(share=share)
        return BalanceLevels(np.ones(3), np.ones(3), criteria=criteria)

    fits = shared_fits.SharedFits()
    start = {"M": np.array([1.0])}
    for start_, foreign in ((start, False), (start, False), ({"M": 2.0}, False), (start, True)):
        assert fits.submit(job, levels(value), start_, foreign=foreign).result()
    assert len(calls) == 3 and fits.counts == {"done": 3, "shared": 1}
    fits.move = low
    assert fits.submit(job, levels(0.4), start, foreign=False).result() and len(calls) == 3
    fits.move = high
    assert not fits.submit(job, levels(0.6), start, foreign=False).result() and len(calls) == 4


def test_a_function_of_objects_is_called_again_for_other_objects_of_equal_content(shared_fits):
    calls = []
    fits = shared_fits.SharedFits()
    function = fits.shared(lambda *given, **named: calls.append(given) or len(calls))
    one, other = np.zeros(1), np.zeros(1)
    assert function(one, ("a", 1), beside=None) == function(one, ("a", 1), beside=None) == 1
    assert function(other, ("a", 1), beside=None) == 2
    assert function(one, ("a", 2), beside=None) == 3
    assert function(one, ("a", 1), beside=True) == 4


def test_what_a_fit_refuses_is_refused_again(shared_fits):
    def job(study):
        raise ValueError("not credible")

    fits = shared_fits.SharedFits()
    for _ in range(2):
        refused = submit(fits, job)
        assert isinstance(refused, Future) and isinstance(refused.exception(), ValueError)
    assert fits.counts == {"done": 1, "shared": 1}


def test_equal_arguments_are_known_again_and_others_are_not(shared_fits):
    text = "ab"
    one = {"a": np.arange(3.0), "names": (text, text)}
    other = {"a": np.arange(3.0), "names": ("ab", "".join(["a", "b"]))}
    assert shared_fits.digest((one,)) == shared_fits.digest((other,))
    for differs in (
        {"a": np.arange(3.0) + 1e-9, "names": ("ab", "ab")},
        {"a": np.arange(3.0).reshape(3, 1), "names": ("ab", "ab")},
        {"a": np.arange(3.0), "names": ("ab", "abc")},
        {"a": np.arange(3), "names": ("ab", "ab")},
    ):
        assert shared_fits.digest((one,)) != shared_fits.digest((differs,))


def test_the_table_tells_what_changes_beside_the_first_cause_apart(moved):
    def change(names, verdict="effect"):
        return {"criterion": "share", "value": 0.12, "verdict": verdict, "names": names}

    near = [{"criterion": "share", "value": 0.12}]
    usual = {"verdict": "effect", "names": ["leakage_P", "stribeck"], "near": near}
    results = {
        "w001": {**usual, "changed": [change(["leakage_P"])]},
        "w002": {**usual, "changed": [change(["stribeck"])]},
        "w003": {**usual, "changed": [change([], "unknown")]},
        "w004": {**usual, "changed": []},
    }
    (row,) = (row for row in moved.table(results) if row["criterion"] == "share")
    assert row["lowered"]["changed"] == [] and row["lowered"]["repeated_in"] == 0
    raised = row["raised"]
    assert raised["repeated_in"] == 4 and raised["changed"] == ["w001", "w002", "w003"]
    assert raised["beside_only"] == 1
    assert (raised["share"], raised["share_word_or_first"]) == (0.75, 0.5)
    figures = moved.figures_of([], results)
    assert (figures["most_share"], figures["most_share_word_or_first"]) == (0.75, 0.5)


def test_no_criterion_moved_by_a_fifth_changes_three_verdicts_of_a_hundred(moved):
    committed = json.loads((BENCHMARKS / "results" / "criteria_moved.json").read_text("utf-8"))
    assert committed["cases"] == 200 and committed["most_share"] < 0.03
    assert {row["criterion"]: row["value"] for row in committed["criteria"]} == asdict(CRITERIA)
    changed = [row[way]["changed"] for row in committed["criteria"] for way in moved.WAYS]
    assert max(map(len, changed)) == round(200 * committed["most_share"]) > 0
