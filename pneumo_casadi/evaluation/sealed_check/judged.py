"""One judged case: what was true, what was said, and what the labels allow to measure."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pneumo_casadi.evaluation.sealed_check.answer import Answer
from pneumo_casadi.evaluation.sealed_check.draw import Draw, Kind
from pneumo_casadi.evaluation.sealed_check.largest import largest_of
from pneumo_casadi.evaluation.sealed_check.true_balance import balances_of

#: Kinds whose cause the catalogue does not hold.
UNKNOWN_CAUSE = (Kind.LEFT_OUT, Kind.NEVER_LISTED)
#: Verdict of a diagnosis that ended in an error.
FAILED = "failed"


@dataclass(frozen=True, slots=True)
class Judged:
    """One case: what was true, what was said, and what the labels allow to measure.

    Parameters
    ----------
    draw : Draw
        The label.
    answer : Answer
        The verdict.
    measured : mapping
        See `measure`.
    """

    draw: Draw
    answer: Answer
    measured: Mapping[str, Any]

    @property
    def causes(self) -> frozenset[str]:
        """True effects."""
        return frozenset(self.draw.effects)

    @property
    def largest(self) -> str | None:
        """The effect without which the gap of the balances is least, if that was measured."""
        gaps = self.measured.get("gap_without")
        return largest_of(gaps) if gaps else None

    @property
    def clouded(self) -> bool:
        """Whether there are weak effects besides."""
        return bool(self.draw.background)

    @property
    def true_names(self) -> frozenset[str]:
        """Effects that it is right to name: the causes, and the weak effects."""
        return (self.causes if self.draw.listed else frozenset()) | self.draw.weak_causes

    @property
    def balances(self) -> frozenset[str]:
        """Balances in which the causes act, in the forms that were recorded."""
        return balances_of(self.causes, self.draw.forms.values())

    @property
    def each_shows(self) -> bool:
        """Whether each cause of a pair is visible beside the other one."""
        beside = self.measured.get("shows_beside", {})
        return bool(beside) and all(beside.values())

    @property
    def kind(self) -> Kind:
        """What the case asks."""
        return self.draw.kind

    @property
    def counts_as_visible(self) -> bool:
        """Whether the cause shows, or there is none."""
        return self.kind is Kind.NONE or bool(self.measured.get("visible"))

    @property
    def first_is_right(self) -> bool:
        """Whether the ranking begins with the causes."""
        return self.draw.listed and bool(self.causes) and self.answer.ranking[:1] == (self.causes,)

    @property
    def shrink_ratio(self) -> float | None:
        """Closure with what was named, over the oracle's; None without an oracle."""
        oracle, own = self.measured.get("oracle_shrink"), self.measured.get("named_shrink")
        if oracle is None or oracle <= 0:
            return None
        return max(0.0, own or 0.0) / float(oracle)

    def as_dict(self) -> dict[str, Any]:
        """Return the case as plain data."""
        return {
            **self.draw.as_dict(),
            "verdict": self.answer.verdict,
            "named": sorted(self.answer.named),
            "offered": sorted(self.answer.offered),
            "ranking": [" + ".join(sorted(names)) for names in self.answer.ranking[:3]],
            "probability": self.answer.probability,
            "balance": self.answer.balance,
            "driver": self.answer.driver,
            "acts_in": sorted(self.answer.acts_in),
            "closes": self.answer.closes,
            "besides": [" or ".join(sorted(names)) for names in self.answer.weak],
            "measured": {**self.measured, "by_error": self.measured.get("by_error", [])[:3]},
        }
