"""Verdicts by effect and by rival: what simple rivals reach, and what is taken for what."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pneumo_casadi.evaluation.sealed_check.draw import Kind
from pneumo_casadi.evaluation.sealed_check.judged import FAILED, UNKNOWN_CAUSE, Judged
from pneumo_casadi.evaluation.sealed_check.tally import Share


def rivals_of(cases: Sequence[Judged]) -> dict[str, Any]:
    """Return what simple rivals reach on the same cases."""
    single = [c for c in cases if c.kind is Kind.SINGLE and "by_error" in c.measured]
    pairs = [c for c in cases if c.kind is Kind.PAIR and "by_aic" in c.measured]
    nothing = [c for c in cases if c.kind is Kind.NONE and "by_aic" in c.measured]
    numbers = [len(c.measured["by_error"]) for c in single if c.measured["by_error"]]

    def in_first(n: int) -> Share:
        return Share.among(c.causes <= set(c.measured["by_error"][:n]) for c in single)

    def chosen(c: Judged) -> set[str]:
        return set(c.measured["by_aic"])

    return {
        "training_error": {
            "right_first": in_first(1).as_dict(),
            "first_three": in_first(3).as_dict(),
        },
        "forward_aic": {
            "right_first": Share.among(chosen(c) == c.causes for c in single).as_dict(),
            "first_chosen": Share.among(
                c.causes == set(c.measured["by_aic"][:1]) for c in single
            ).as_dict(),
            "pair_one": Share.among(bool(chosen(c) & c.causes) for c in pairs).as_dict(),
            "pair_both": Share.among(chosen(c) >= c.causes for c in pairs).as_dict(),
            "false_alarm": Share.among(bool(chosen(c)) for c in nothing).as_dict(),
        },
        "chance": {
            f"{name}_percent": float(np.mean([100 * k / n for n in numbers])) if numbers else None
            for name, k in (("right_first", 1), ("first_three", 3))
        },
    }


def per_effect(cases: Sequence[Judged]) -> dict[str, Any]:
    """Return, by effect of the singles, what was named of it at each severity."""
    table: dict[str, Any] = {}
    for case in cases:
        if case.kind is not Kind.SINGLE:
            continue
        ((name, severity),) = case.draw.effects.items()
        row = table.setdefault(name, {})
        cell = row.setdefault(severity, {"right_first": 0, "first_three": 0, "visible": 0, "of": 0})
        cell["of"] += 1
        cell["visible"] += int(bool(case.measured.get("visible")))
        cell["right_first"] += int(case.answer.named == case.causes)
        cell["first_three"] += int(case.causes in case.answer.ranking[:3])
    return dict(sorted(table.items()))


def confusion(cases: Sequence[Judged]) -> dict[str, Any]:
    """Return counts of what was said (columns) of what was true (rows), pairs left out."""
    counts: dict[tuple[str, str], int] = {}
    for case in cases:
        if case.kind is Kind.PAIR:
            continue
        row = next(iter(case.causes), "none") if case.draw.listed else case.kind.value
        named = sorted(case.answer.named)
        column = case.answer.verdict if not named else named[0] if len(named) == 1 else "several"
        counts[row, column] = counts.get((row, column), 0) + 1
    last = ("several", "absorbed", "ambiguous", "effect", "none", "unknown", FAILED)
    ends = (*(kind.value for kind in (Kind.NONE, *UNKNOWN_CAUSE)), *last)
    rows = sorted({row for row, _ in counts}, key=lambda name: (_at(name, ends), name))
    columns = sorted(
        {column for _, column in counts} | {row for row in rows if row not in ends},
        key=lambda name: (_at(name, last), name),
    )
    table = [[counts.get((row, column), 0) for column in columns] for row in rows]
    return {"rows": rows, "columns": columns, "counts": table}


def _at(name: str, ends: Sequence[str]) -> int:
    return ends.index(name) if name in ends else -1
