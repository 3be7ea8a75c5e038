"""What a diagnosis says: the verdict, its reasons, and how far the gap closes."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

import pandas as pd

from pneumo_casadi.diagnosis.locate.evidence import Evidence
from pneumo_casadi.diagnosis.metrics.findings import (
    Candidate,
    Check,
    EffectFound,
    Gap,
    Value,
    Where,
    joined_names,
)
from pneumo_casadi.diagnosis.wording.location_sentences import location_sentences
from pneumo_casadi.runtime.presentation import Presentable
from pneumo_casadi.valve import FormSelection

#: Lines of the ranking that a summary shows.
MOST_SHOWN = 8


class Verdict(Enum):
    """What may be said of a case."""

    EFFECT = "effect"
    """One effect, or several together, close the gap, and no other explains it as well."""
    AMBIGUOUS = "ambiguous"
    """Several effects close the gap alike: the data cannot tell them apart."""
    ABSORBED = "absorbed"
    """Parameters that contradict geometry or data sheet, and little or no gap in trajectories."""
    UNKNOWN = "unknown"
    """A gap that nothing in the catalogue closes."""
    NONE = "none"
    """No gap that matters."""


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Presentable):
    """What is said of a case.

    Parameters
    ----------
    case : str
        Name.
    verdict : Verdict
        In one word.
    effects : tuple of EffectFound
        Added, in that order; empty for none, unknown and absorbed.
    ranking : tuple of Candidate
        All candidates, the most probable first, failed ones last.
    where : Where
        Location.
    gap : Gap
        Before and after.
    ambiguous : tuple of tuple of str
        Models, each by the names of its effects, that the data cannot tell apart, the most
        probable first.
    experiment : str
        What would tell them apart; empty where nothing is open.
    hint : str
        For ``unknown``: balance, regime and shape of what is missing.
    checks : tuple of Check
        Parameters against geometry and data sheet.
    notes : tuple of str
        What a reader must know: recovered fits, failed candidates, map left.
    nominal, fitted : mapping of str to Value
        Parameters without and with the effects found.
    seconds : float
        Time taken.
    evidence : Evidence or None
        Curves for figures: unknown inputs over time, residuals over what went on.
    flow_selection : FormSelection or None
        How the form of the flow map was chosen; None for a force-driven axis.

    Examples
    --------
    With ``diagnosis = pc.diagnose(pc.example_case())``:

    >>> print(diagnosis.summary().splitlines()[0])
    Diagnosis of table1: none; error on held-out data ... % -> ... % of the signals
    >>> diagnosis.to_frame().columns[:2].tolist()
    ['probability', 'closure']
    """

    case: str
    verdict: Verdict
    effects: tuple[EffectFound, ...]
    ranking: tuple[Candidate, ...]
    where: Where
    gap: Gap
    ambiguous: tuple[tuple[str, ...], ...]
    experiment: str
    hint: str
    checks: tuple[Check, ...]
    notes: tuple[str, ...]
    nominal: Mapping[str, Value]
    fitted: Mapping[str, Value]
    seconds: float
    evidence: Evidence | None = None
    flow_selection: FormSelection | None = None

    @property
    def headline(self) -> str:
        """Verdict, effects and the error on held-out data before and after."""
        names = " + ".join(item.name for item in self.effects)
        verdict = f"{self.verdict.value} ({names})" if names else self.verdict.value
        return (
            f"Diagnosis of {self.case}: {verdict}; error "
            f"on held-out data {self.gap.before:.3g} % -> {self.gap.after:.3g} % of the signals"
        )

    def to_frame(self) -> pd.DataFrame:
        """Return the ranking: probability, and the share of the error that each one removes."""
        rows = [
            (
                item.label,
                item.probability,
                None if item.closure is None else item.closure.value,
                None if item.closure is None else item.closure.lower,
                None if item.closure is None else item.closure.upper,
            )
            for item in self.ranking
        ]
        columns = ["effects", "probability", "closure", "closure_lower", "closure_upper"]
        return pd.DataFrame(rows, columns=columns).set_index("effects")

    def overview(self) -> pd.DataFrame:
        """Return the first lines of the ranking."""
        return self.to_frame().head(MOST_SHOWN)

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain data, the keys of the design first."""
        closure = self.gap.closure
        return {
            "verdict": self.verdict.value,
            "effects": [
                {
                    "name": one.name,
                    "probability": one.probability,
                    "parameters": _values(one.parameters),
                }
                for one in self.effects
            ],
            "ranking": [
                {
                    "name": one.label,
                    "probability": one.probability,
                    "held_out_shrink": None if one.closure is None else one.closure.value,
                    "shrink_interval": (
                        None if one.closure is None else [one.closure.lower, one.closure.upper]
                    ),
                    "explained": one.explained,
                    "observable": one.observable,
                    "parameters": _values(one.parameters),
                    "failure": one.failure or None,
                }
                for one in self.ranking
            ],
            "where": {
                "balance": self.where.balance.value,
                "junction": "" if self.where.junction is None else self.where.junction.value,
                "regimes": [one.name for one in self.where.regimes],
                "regime_details": [
                    {
                        "name": one.name,
                        "balance": one.balance.value,
                        "share": one.share,
                        "time": one.time,
                        "p_value": one.p_value,
                    }
                    for one in self.where.regimes
                ],
                "shares": dict(self.where.shares),
                "rivals": list(self.where.rivals),
                "words": list(location_sentences(self.where)),
            },
            "gap": {
                "before": self.gap.before,
                "after": self.gap.after,
                "noise_floor": self.gap.noise_floor,
                "shrink": closure.value,
                "shrink_interval": [closure.lower, closure.upper],
                "views": {
                    view: {name: dict(values) for name, values in outputs.items()}
                    for view, outputs in self.gap.views.items()
                },
            },
            "ambiguous": [joined_names(names) for names in self.ambiguous],
            "experiment": self.experiment,
            "hint": self.hint,
            "checks": [
                {
                    "name": one.name,
                    "value": one.value,
                    "std": one.std,
                    "expected": one.expected,
                    "tolerance": one.tolerance,
                    "unit": one.unit,
                    "agrees": one.agrees,
                    "text": one.text,
                }
                for one in self.checks
            ],
            "notes": list(self.notes),
            "parameters": {"nominal": _values(self.nominal), "fitted": _values(self.fitted)},
            "flow_selection": (
                None if self.flow_selection is None else self.flow_selection.as_dict()
            ),
            "case": self.case,
            "seconds": self.seconds,
        }


def _values(values: Mapping[str, Value]) -> dict[str, dict[str, Any]]:
    return {
        name: {"value": value.value, "std": value.std, "unit": value.unit}
        for name, value in values.items()
    }
