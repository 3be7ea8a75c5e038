"""The result of a diagnosis: verdict, reasons, and closure of the gap."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import pandas as pd

from pneumo_casadi.data import Finding
from pneumo_casadi.diagnosis.discover.discovered import DiscoveredTerm
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
from pneumo_casadi.diagnosis.metrics.verdict import Verdict
from pneumo_casadi.diagnosis.result.plain_findings import (
    FORMAT,
    candidate_dict,
    discovered_dict,
    effect_dict,
    gap_dict,
    values_dict,
    where_dict,
)
from pneumo_casadi.runtime.json_files import without_infinities
from pneumo_casadi.runtime.presentation import Presentable
from pneumo_casadi.valve import FormSelection

#: Lines of the ranking that a summary shows.
MOST_SHOWN = 8


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Presentable):
    """Result of a diagnosis.

    Parameters
    ----------
    case : str
        Name.
    verdict : Verdict
        Conclusion.
    effects : tuple of EffectFound
        Effects that are named, the one that is missed most first; empty for the verdicts
        none, unknown and absorbed.
    undecided : tuple of EffectFound
        Further effects of the final model that the data cannot distinguish from their `rivals`:
        one of these acts, but which one is not known. The verdict is ``ambiguous`` if they close
        more than next to nothing and the set with them is not probable enough.
    besides : tuple of EffectFound
        Effects of the final model that are probably also there, each too small to be named.
    corrections : tuple of EffectFound
        Effects of the final model that take up what the form of the flow map misses: they correct
        the map, and are no cause.
    unsupported : tuple of EffectFound
        Effects of the final model for which held-out records do not ask, or that have no size: they
        only keep the others right, and nothing is said of them.
    absorbed : tuple of str
        Effects that the parameters have absorbed beside those named: no simulation shows them, a
        parameter that contradicts the geometry does. Of the verdict absorbed see `ambiguous`.
    ranking : tuple of Candidate
        All candidates, the most probable first, failed ones last.
    where : Where
        Balance or sensor, and operating conditions, in which model and measurement disagree.
    gap : Gap
        Error of the simulation on held-out records above the sensor noise, without and with the
        effects, in per cent of the standard deviation of each signal.
    ambiguous : tuple of tuple of str
        Models that the data cannot separate, each by the names of its effects, the most probable
        first.
    experiment : str
        Experiment that would separate them, or the effects that are undecided; empty where the
        data tell.
    hint : str
        For ``unknown``: balance, regime and shape of what is missing.
    checks : tuple of Check
        Parameters against geometry and data sheet.
    notes : tuple of str
        Remarks: records split, simulations and fits that failed.
    nominal, fitted : mapping of str to Value
        Parameters without and with the effects found.
    seconds : float
        Computing time [s].
    evidence : Evidence or None
        Curves for figures: unknown inputs over time, residuals over operating conditions.
    flow_selection : FormSelection or None
        How the form of the flow map was chosen; None for a force-driven axis.
    discovered : DiscoveredTerm or None
        For ``unknown``: the term outside the catalogue that closes most of the gap, as a
        formula; None where there is none.
    findings : tuple of Finding
        Severe findings of the check of the records, such as a sensor that contradicts the others:
        correct these before you look for a cause in the axis.
    with_term : mapping of str to Value
        As `nominal`, with the discovered term in the model; empty where there is none.
    refined_checks : tuple of Check
        As `checks`, of the final model refined by output error, whose parameters are those to use;
        empty where it was not refined.
    provenance : mapping
        What is needed to repeat it: date, versions, options, records and hashes of the data.

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
    discovered: DiscoveredTerm | None = None
    findings: tuple[Finding, ...] = ()
    undecided: tuple[EffectFound, ...] = ()
    besides: tuple[EffectFound, ...] = ()
    corrections: tuple[EffectFound, ...] = ()
    unsupported: tuple[EffectFound, ...] = ()
    absorbed: tuple[str, ...] = ()
    with_term: Mapping[str, Value] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    refined_checks: tuple[Check, ...] = ()

    @property
    def final_checks(self) -> tuple[Check, ...]:
        """The checks of the parameters to use: of the refined model where there is one."""
        return self.refined_checks or self.checks

    @property
    def final_effects(self) -> tuple[EffectFound, ...]:
        """All effects of the final model: those named, those undecided, and those unnamed."""
        return (*self.effects, *self.undecided, *self.unnamed_effects)

    @property
    def unnamed_effects(self) -> tuple[EffectFound, ...]:
        """Effects of the final model that are not named, whatever is said of them."""
        return (*self.besides, *self.corrections, *self.unsupported)

    @property
    def headline(self) -> str:
        """Verdict, effects and the error on held-out data before and after."""
        names = " + ".join(item.name for item in self.effects)
        verdict = f"{self.verdict.value} ({names})" if names else self.verdict.value
        term = self.gap.with_term
        after = self.gap.after if term is None else term
        return (
            f"Diagnosis of {self.case}: {verdict}; error on held-out data "
            f"{self.gap.before:.3g} % -> {after:.3g} % of the signals"
            f"{'' if term is None else ', with the discovered term'}"
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
        """Return everything but the curves as plain data, verdict and reasons first.

        `read_diagnosis` makes a diagnosis of it again. A number that is not finite is None.
        """
        content: dict[str, Any] = {
            "verdict": self.verdict.value,
            "effects": [effect_dict(effect) for effect in self.effects],
            "undecided": [effect_dict(effect) for effect in self.undecided],
            "besides": [effect_dict(effect) for effect in self.besides],
            "corrections": [effect_dict(effect) for effect in self.corrections],
            "unsupported": [effect_dict(effect) for effect in self.unsupported],
            "absorbed": list(self.absorbed),
            "ranking": [candidate_dict(candidate) for candidate in self.ranking],
            "where": where_dict(self.where),
            "gap": gap_dict(self.gap),
            "ambiguous": [joined_names(names) for names in self.ambiguous],
            "experiment": self.experiment,
            "hint": self.hint,
            "checks": [asdict(check) for check in self.checks],
            "refined_checks": [asdict(check) for check in self.refined_checks],
            "notes": list(self.notes),
            "findings": [finding.as_dict() for finding in self.findings],
            "parameters": {
                "nominal": values_dict(self.nominal),
                "fitted": values_dict(self.fitted),
                "with_term": values_dict(self.with_term),
            },
            "flow_selection": (
                None if self.flow_selection is None else self.flow_selection.as_dict()
            ),
            "discovered": None if self.discovered is None else discovered_dict(self.discovered),
            "case": self.case,
            "seconds": self.seconds,
            "provenance": dict(self.provenance),
            "format": FORMAT,
        }
        plain: dict[str, Any] = without_infinities(content)
        return plain
