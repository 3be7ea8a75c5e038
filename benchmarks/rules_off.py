"""Question: which verdicts would be others without one of the rules, and would they be worse.

Data: draws of the virtual bench as for `criteria_moved`. Each is diagnosed with all rules, then
without each rule that did something in it. A verdict is right where it names the causes drawn and
none that is not there (weak effects that are there may be named, and need not be), and ``unknown``
where the catalogue lacks the cause. A rule earns its place by verdicts that are right with it only;
one by which nothing is gained can go.
"""

import importlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import criteria_moved
from movable import Move, note

from pneumo_casadi.diagnosis.metrics.verdict import Verdict
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA, Criteria
from pneumo_casadi.diagnosis.select.complete import Completed
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger
from pneumo_casadi.evaluation.sealed_check.draw import Draw

DIAGNOSIS = "pneumo_casadi.diagnosis"


@dataclass(frozen=True)
class Rule:
    """A function that a verdict may rest on, and what stands for it.

    Parameters
    ----------
    does : str
        What it does, in a few words.
    where : str
        Module and name by which it is called, within the diagnosis.
    instead : callable
        Given the same arguments, what a diagnosis without it would go on with.
    """

    does: str
    where: str
    instead: Callable[..., Any]


def _nothing(*given: Any, **named: Any) -> None:
    return None


def _no(*given: Any, **named: Any) -> bool:
    return False


def _yes(*given: Any, **named: Any) -> bool:
    return True


def _third(*given: Any) -> Any:
    return given[2]


def _only_final(*given: Any) -> Completed:
    return Completed(given[2], given[2])


RULES = (
    Rule("another partner in a pair", "select.forward_selection._backtrack", _third),
    Rule(
        "a hiding effect by simulation",
        "select.forward_selection.find_hiding_extension",
        _nothing,
    ),
    Rule("enough in simulation", "select.forward_selection.closes_in_simulation", _no),
    Rule("another form beside others", "select.forward_selection.with_other_form", _third),
    Rule("on by simulation", "select.forward_selection.extend_by_simulation", _third),
    Rule("a coarse map is no cause", "select.forward_selection.only_corrects_map", _no),
    Rule("nor beside others", "select.complete.only_corrects_map", _no),
    Rule(
        "leading causes in all forms",
        "select.forward_selection.fit_forms_of_leading_causes",
        _nothing,
    ),
    Rule("weak ones by simulation", "select.forward_selection.complete_by_simulation", _only_final),
    Rule("weak effects besides", "select.forward_selection.complete", _only_final),
    Rule("exchange of effects", "select.complete._Completion._exchange", _nothing),
    Rule(
        "review of the completed model",
        "select.complete._Completion.review",
        lambda _, names: names,
    ),
    Rule("the best alone of each balance", "select.propose._for_open_balances", lambda *_: []),
    Rule("the most promising of each balance", "select.propose._promising_in", lambda *_: []),
    Rule("an open force asks for more", "select.acceptance._force_is_open", _no),
    Rule("a hidden model needs its effects", "select.hidden_motion._is_needed", _yes),
    Rule("without needless ones", "select.hidden_motion._without_needless", lambda *g: g[2][-1]),
    Rule("one form leaves nothing", "decide.judgement.left_by_one_form", lambda *_: 0.0),
    Rule("trust by what is left", "decide.judgement._trust", lambda *_: 0.97),
    Rule(
        "review by the parameters",
        "decide.decision.review_verdict",
        lambda judgement, *_: (judgement.verdict, ()),
    ),
    Rule("less left than absorbed", "decide.credibility.leaves_less_than_absorbed", _yes),
    Rule("valve N by the flows", "decide.credibility.may_be_valve_N", _yes),
    Rule("rather one cause", "conclude.rather_one_cause", lambda *_: ""),
    Rule("a term instead of effects", "conclude.find_rival_term", _nothing),
)


def move_of(rule: Rule) -> Move:
    """Return what stands for a rule among the moves."""
    return Move(rule.does, 0.0)


def _owner(rule: Rule) -> tuple[Any, str]:
    *path, name = rule.where.split(".")
    parts = [part for part in path if not part.startswith("_")]
    owner: Any = importlib.import_module(".".join((DIAGNOSIS, *parts)))
    for part in path[len(parts) :]:
        owner = getattr(owner, part)
    return owner, name


def _watched(rule: Rule, usual: Callable[..., Any]) -> Callable[..., Any]:
    """Return a rule that notes where it does anything."""

    def watched(*given: Any, **named: Any) -> Any:
        before = _state(given[0])
        try:
            result = usual(*given, **named)
        except Exception:
            note({move_of(rule)})
            raise
        if _state(given[0]) != before or not _same(result, rule.instead(*given, **named)):
            note({move_of(rule)})
        return result

    return watched


def _state(first: Any) -> Any:
    """Return what a rule may have changed in the ledger that it was given."""
    ledger = getattr(first, "ledger", first)
    if not isinstance(ledger, FitLedger):
        return None
    held = ledger.fits, ledger.trials, ledger.gap_left, ledger.output_error_fits, ledger.reduced
    tried = ledger.failures, ledger.left_out, ledger._refined
    return [dict(each) for each in held], [set(each) for each in tried]


def _same(result: Any, other: Any) -> bool:
    try:
        return bool(result == other)
    except ValueError:  # of arrays
        return False


@contextmanager
def all_watched() -> Iterator[Criteria]:
    """Note within which rules do anything."""
    with ExitStack() as stack:
        for rule in RULES:
            owner, name = _owner(rule)
            usual = getattr(owner, name)
            stack.enter_context(patch.object(owner, name, _watched(rule, usual)))
        yield CRITERIA


@contextmanager
def without(move: Move) -> Iterator[Criteria]:
    """Do without the rule that a move stands for."""
    (rule,) = (rule for rule in RULES if move_of(rule) == move)
    owner, name = _owner(rule)
    with patch.object(owner, name, rule.instead):
        yield CRITERIA


def right(draw: Draw, verdict: str, names: list[str]) -> bool:
    """Return whether a verdict is right of a draw."""
    causes, weak = set(draw.effects), set(draw.weak_causes)
    if verdict not in {each.value for each in Verdict}:  # an error
        return False
    if not draw.listed:
        return verdict == Verdict.UNKNOWN.value
    # Of those that the parameters may have absorbed the first is the most likely one.
    named = set(names[:1] if verdict == Verdict.ABSORBED.value else names)
    return causes <= named <= causes | weak and verdict != Verdict.UNKNOWN.value


def one_draw(draw: Draw, keep: Path) -> dict[str, Any]:
    """Diagnose a draw with and without its rules, or read what an interrupted run has found."""
    return criteria_moved.kept(draw, keep, watched=all_watched, moved=without)


def figures_of(draws: Sequence[Draw], results: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return a row for each rule."""
    return {"rules": [row(rule, draws, results) for rule in RULES]}


def row(
    rule: Rule, draws: Sequence[Draw], results: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """Return where a rule does something, where it changes a verdict, and which is right."""
    by_name = {draw.name: draw for draw in draws}
    worse: list[str] = []
    better: list[str] = []
    neither: list[str] = []
    for case, result in results.items():
        for change in result["changed"]:
            if change["criterion"] != rule.does:
                continue
            with_it = right(by_name[case], result["verdict"], result["names"])
            without_it = right(by_name[case], change["verdict"], change["names"])
            (neither if with_it == without_it else worse if with_it else better).append(case)
    acts = sum(
        rule.does == move["criterion"] for result in results.values() for move in result["near"]
    )
    return {
        "rule": rule.does,
        "where": rule.where,
        "acts_in": acts,
        "worse_without": worse,
        "better_without": better,
        "as_right": neither,
    }


if __name__ == "__main__":
    criteria_moved.run(__doc__, one_draw, figures_of)
