"""How good verdicts are, counted against the labels.

Which cases a score is about, and when it is a hit (see `read_answer` for *named*, *offered* and
*ranking*):

==================  ==========================  ================================================
score               cases                       hit
==================  ==========================  ================================================
right_first         singles                     *named* is the cause and nothing else
ranked_first        singles                     the ranking begins with it, whatever the verdict
first_three         singles                     it is among the first three of the ranking
set_covers          singles                     *offered* holds it
set_covers_given    singles with an *offered*   *offered* holds it
false_alarm         nothing wrong               anything is *named*
unknown_caught      left out, never listed      the verdict is ``unknown``
wrongly_named       left out, never listed      anything is *named*
false_unknown       all others                  the verdict is ``unknown``
located             all with causes but         the stated balance is one where a cause acts
                    absorbed
pair_one            pairs                       *named* holds one of the causes, or both
pair_both           pairs                       *named* holds both
pair_both_shown     pairs of which each cause   *named* holds both
                    shows beside the other one
absorbed_told       absorbed                    *offered* holds the cause
absorbed_misnamed   absorbed                    something is *named*, but *offered* lacks it
failed              all                         the diagnosis ended in an error
==================  ==========================  ================================================

For the verdict ``ambiguous``, *named* is the first effect of the set; ``set_size`` is the mean size
of *offered* among singles with a set. For ``absorbed``, *named* is the first effect that the
parameters may have absorbed. Scores are computed twice: "all" has all cases, where ``none`` is a
miss even if the effect is too small to be visible; "visible" has the cases with a visible cause
(`measure`) and those where nothing is wrong. Calibration is computed over all clean cases: the
first entry of the ranking, with its stated probability, is a hit if it equals the set of causes. It
is never a hit if nothing is wrong or the causes are not in the catalogue.

These scores are about clean cases. Cases with a background of weak effects have their own, under
``background``; what is told as probably also there counts in all cases (`besides`):

==================  ==========================  ================================================
names_true          every effect *named*        it is a cause, or one of the weak effects
dominant_named      singles                     *named* holds the cause, drawn as dominant
dominant_first      singles                     the cause is the first effect named
largest_named       singles                     *named* holds the effect with the largest gap,
                                                whether it is the cause or a weak one (`largest`)
largest_first       singles                     it is the first effect named
pair_one            pairs                       *named* holds one of the causes, or both
false_alarm         nothing but weak effects    an effect is *named* that is not there
unknown_caught      left out, never listed      the verdict is ``unknown``
unknown_largest     those whose cause has the   the verdict is ``unknown``
                    largest gap
located             as above                    as above
besides             every effect told as        it is a cause, or one of the weak effects, or one of
                    probably also there         those that may act in its place is
==================  ==========================  ================================================
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from pneumo_casadi.evaluation.sealed_check.breakdown import confusion, per_effect, rivals_of
from pneumo_casadi.evaluation.sealed_check.draw import Kind
from pneumo_casadi.evaluation.sealed_check.judged import FAILED, UNKNOWN_CAUSE, Judged
from pneumo_casadi.evaluation.sealed_check.tally import Share, calibration
from pneumo_casadi.virtual_bench import FORMS

#: By score: which cases, and when it is a hit.
SCORES: Mapping[str, tuple[Callable[[Judged], bool], Callable[[Judged], bool]]] = {
    "right_first": (lambda c: c.kind is Kind.SINGLE, lambda c: c.answer.named == c.causes),
    "ranked_first": (lambda c: c.kind is Kind.SINGLE, lambda c: c.first_is_right),
    "first_three": (lambda c: c.kind is Kind.SINGLE, lambda c: c.causes in c.answer.ranking[:3]),
    "set_covers": (lambda c: c.kind is Kind.SINGLE, lambda c: c.causes <= c.answer.offered),
    "set_covers_given": (
        lambda c: c.kind is Kind.SINGLE and bool(c.answer.offered),
        lambda c: c.causes <= c.answer.offered,
    ),
    "false_alarm": (lambda c: c.kind is Kind.NONE, lambda c: bool(c.answer.named)),
    "unknown_caught": (lambda c: c.kind in UNKNOWN_CAUSE, lambda c: c.answer.verdict == "unknown"),
    "unknown_caught_left_out": (
        lambda c: c.kind is Kind.LEFT_OUT,
        lambda c: c.answer.verdict == "unknown",
    ),
    "unknown_caught_never_listed": (
        lambda c: c.kind is Kind.NEVER_LISTED,
        lambda c: c.answer.verdict == "unknown",
    ),
    "wrongly_named": (lambda c: c.kind in UNKNOWN_CAUSE, lambda c: bool(c.answer.named)),
    "false_unknown": (
        lambda c: c.kind not in UNKNOWN_CAUSE,
        lambda c: c.answer.verdict == "unknown",
    ),
    "located": (
        lambda c: c.kind not in (Kind.NONE, Kind.ABSORBED),
        lambda c: c.answer.balance in c.balances,
    ),
    "located_single": (
        lambda c: c.kind is Kind.SINGLE,
        lambda c: c.answer.balance in c.balances,
    ),
    "pair_one": (lambda c: c.kind is Kind.PAIR, lambda c: bool(c.answer.named & c.causes)),
    "pair_both": (lambda c: c.kind is Kind.PAIR, lambda c: c.answer.named >= c.causes),
    "pair_both_shown": (
        lambda c: c.kind is Kind.PAIR and c.each_shows,
        lambda c: c.answer.named >= c.causes,
    ),
    "absorbed_told": (lambda c: c.kind is Kind.ABSORBED, lambda c: c.causes <= c.answer.offered),
    "absorbed_misnamed": (
        lambda c: c.kind is Kind.ABSORBED,
        lambda c: bool(c.answer.named) and not c.causes <= c.answer.offered,
    ),
    "failed": (lambda c: True, lambda c: c.answer.verdict == FAILED),
}


def scored(cases: Sequence[Judged]) -> dict[str, Any]:
    """Return all scores as plain data: for all cases, and for those whose cause is visible."""
    every, cases = cases, [case for case in cases if not case.clouded]
    visible = [case for case in cases if case.counts_as_visible]
    return {
        "cases": len(every),
        "clean": len(cases),
        "kinds": {kind.value: sum(case.kind is kind for case in every) for kind in Kind},
        "unmeasured": sum("failure" in case.measured for case in every),
        "scores": {"all": scores_of(cases), "visible": scores_of(visible)},
        "rivals": {"all": rivals_of(cases), "visible": rivals_of(visible)},
        "effects": per_effect(cases),
        "confusion": confusion(cases),
        "calibration": calibration(
            [case.answer.probability for case in cases], [case.first_is_right for case in cases]
        ).as_dict(),
        "background": background_scores([case for case in every if case.clouded]),
        "besides": Share.among(
            bool(names & case.true_names) for case in every for names in case.answer.weak
        ).as_dict(),
        "discovered": discovered_scores(every),
        "each": [case.as_dict() for case in every],
    }


def background_scores(cases: Sequence[Judged]) -> dict[str, Any]:
    """Return the scores of cases with weak effects besides, for all and for visible causes."""
    return {
        "cases": len(cases),
        **{
            name: {
                key: Share.among(answers).as_dict()
                for key, answers in _background_answers(group).items()
            }
            for name, group in (
                ("all", cases),
                ("visible", [case for case in cases if case.counts_as_visible]),
            )
        },
    }


def _background_answers(cases: Sequence[Judged]) -> dict[str, list[bool]]:
    singles = [case for case in cases if case.kind is Kind.SINGLE]
    measured = [case for case in singles if case.largest]
    unlisted = [case for case in cases if case.kind in UNKNOWN_CAUSE]
    return {
        "names_true": [name in c.true_names for c in cases for name in sorted(c.answer.named)],
        "dominant_named": [case.causes <= case.answer.named for case in singles],
        "dominant_first": [case.answer.first in case.causes for case in singles],
        "largest_named": [case.largest in case.answer.named for case in measured],
        "largest_first": [case.answer.first == case.largest for case in measured],
        "pair_one": [
            bool(case.causes & case.answer.named) for case in cases if case.kind is Kind.PAIR
        ],
        "false_alarm": [
            bool(case.answer.named - case.true_names) for case in cases if case.kind is Kind.NONE
        ],
        "unknown_caught": [case.answer.verdict == "unknown" for case in unlisted],
        "unknown_largest": [
            case.answer.verdict == "unknown" for case in unlisted if case.largest in case.causes
        ],
        "located": [
            case.answer.balance in case.balances
            for case in cases
            if case.kind not in (Kind.NONE, Kind.ABSORBED)
        ],
    }


def discovered_scores(cases: Sequence[Judged]) -> dict[str, Any]:
    """Return how good discovered terms are.

    `driver_right` is a hit where the term of a cause that no catalogue has acts in a balance of the
    cause, and depends on what the cause depends on; under ``visible`` of the causes that are.
    `false_term` is one where a term is told although every cause is listed.
    """
    unlisted = [case for case in cases if case.kind is Kind.NEVER_LISTED]
    listed = [case for case in cases if case.draw.listed]
    closed = [case.answer.closes for case in unlisted if case.answer.closes is not None]
    return {
        "driver_right": Share.among(_term_is_right(case) for case in unlisted).as_dict(),
        "visible": {
            "driver_right": Share.among(
                _term_is_right(case) for case in unlisted if case.counts_as_visible
            ).as_dict()
        },
        "closes": {"median": float(np.median(closed)) if closed else None, "of": len(closed)},
        "false_term": Share.among(bool(case.answer.driver) for case in listed).as_dict(),
    }


def _term_is_right(case: Judged) -> bool:
    """Return whether a term acts where the cause does, and its driver is that of the cause."""
    driver = case.answer.driver
    # Which pressure it is the form says; time and travel since a reversal are other drivers.
    driver = "p" if driver.startswith("p_") else driver
    acts = bool(case.answer.acts_in) and case.answer.acts_in <= case.balances
    return acts and driver in {FORMS[name].driver for name in case.causes}


def scores_of(cases: Sequence[Judged]) -> dict[str, Any]:
    """Return the scores of some cases."""
    scores: dict[str, Any] = {
        name: Share.among(hit(case) for case in cases if about(case)).as_dict()
        for name, (about, hit) in SCORES.items()
    }
    sizes = [len(c.answer.offered) for c in cases if c.kind is Kind.SINGLE and c.answer.offered]
    ratios = [c.shrink_ratio for c in cases if c.kind in (Kind.SINGLE, Kind.PAIR)]
    known = [ratio for ratio in ratios if ratio is not None]
    scores["set_size"] = {"mean": float(np.mean(sizes)) if sizes else None, "of": len(sizes)}
    scores["shrink_of_oracle"] = {
        "median": float(np.median(known)) if known else None,
        "of": len(known),
    }
    return scores
