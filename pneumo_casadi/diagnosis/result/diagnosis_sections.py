"""The parts of `diagnosis.json`, typed, and the diagnosis that is made of them again."""

from typing import Any

import msgspec
import numpy as np

from pneumo_casadi.diagnosis.discover.discovered import DiscoveredTerm, TermCurve
from pneumo_casadi.diagnosis.metrics.findings import Closure, split_names
from pneumo_casadi.diagnosis.metrics.verdict import Verdict
from pneumo_casadi.diagnosis.result.diagnosis_result import Diagnosis
from pneumo_casadi.diagnosis.result.finding_sections import (
    CandidateSection,
    CheckSection,
    EffectSection,
    FindingSection,
    GapSection,
    ValueSection,
    WhereSection,
    values_of,
)
from pneumo_casadi.effects.term import Term
from pneumo_casadi.errors import CaseError
from pneumo_casadi.runtime.json_input import Section
from pneumo_casadi.valve import FlowForm, FormError, FormSelection, Reason


class FormErrorSection(Section):
    """Held-out error of a form of the flow map."""

    form: FlowForm
    degrees: tuple[int, int, int] | None
    held_out_percent: float | None
    standard_error_percent: float | None
    failure: str | None


class FlowSelectionSection(Section):
    """How the form of the flow map was chosen."""

    chosen: FlowForm
    reason: str
    folds: int
    candidates: tuple[FormErrorSection, ...]

    @property
    def read(self) -> FormSelection:
        """The selection."""
        try:
            reason = Reason[self.reason.upper()]
        except KeyError:
            raise CaseError(f"`flow_selection.reason`: no reason {self.reason!r}") from None
        candidates = tuple(
            FormError(
                item.form, item.degrees, item.held_out_percent, item.standard_error_percent,
                item.failure or "",
            )
            for item in self.candidates
        )  # fmt: skip
        return FormSelection(self.chosen, reason, candidates, self.folds)


class ClosesSection(Section):
    """How far a discovered term closes the gap."""

    value: float
    interval: tuple[float, float]


class CurveSection(Section):
    """A discovered term without a formula."""

    driver: tuple[float | None, ...]
    value: tuple[float | None, ...]
    band: tuple[float | None, ...]
    formula: tuple[float | None, ...]

    @property
    def read(self) -> TermCurve:
        """The curve; what is null was not finite."""
        parts = (self.driver, self.value, self.band, self.formula)
        if len(set(map(len, parts))) != 1:
            raise CaseError("`discovered.curve`: its columns differ in length")
        return TermCurve(*(np.array(part, dtype=float) for part in parts))


class DiscoveredSection(Section):
    """A term outside the catalogue."""

    name: str
    balances: tuple[str, ...]
    factor: str
    driver: str
    form: str
    parameters: dict[str, ValueSection]
    closes: ClosesSection
    beside: tuple[str, ...]
    curve: CurveSection

    @property
    def read(self) -> DiscoveredTerm:
        """The term."""
        quantities = values_of(self.parameters)
        values = {name: item.value for name, item in quantities.items()}
        return DiscoveredTerm(
            Term(self.name, self.balances, self.factor, self.driver, self.form, values),
            {name: item.std for name, item in quantities.items()},
            Closure(self.closes.value, *self.closes.interval),
            self.beside,
            self.curve.read,
        )


class ParametersSection(Section):
    """Parameters without and with the effects found."""

    nominal: dict[str, ValueSection]
    fitted: dict[str, ValueSection]
    with_term: dict[str, ValueSection] = msgspec.field(default_factory=dict)


class DiagnosisSection(Section):
    """What is read of a `diagnosis.json`."""

    case: str
    verdict: Verdict
    effects: tuple[EffectSection, ...]
    undecided: tuple[EffectSection, ...]
    ranking: tuple[CandidateSection, ...]
    where: WhereSection
    gap: GapSection
    ambiguous: tuple[str, ...]
    experiment: str
    hint: str
    checks: tuple[CheckSection, ...]
    notes: tuple[str, ...]
    findings: tuple[FindingSection, ...]
    parameters: ParametersSection
    flow_selection: FlowSelectionSection | None
    discovered: DiscoveredSection | None
    seconds: float
    provenance: dict[str, Any] = msgspec.field(default_factory=dict)
    refined_checks: tuple[CheckSection, ...] = ()
    besides: tuple[EffectSection, ...] = ()
    corrections: tuple[EffectSection, ...] = ()
    unsupported: tuple[EffectSection, ...] = ()
    absorbed: tuple[str, ...] = ()

    @property
    def read(self) -> Diagnosis:
        """The diagnosis, without its curves."""
        flow, term = self.flow_selection, self.discovered
        return Diagnosis(
            case=self.case,
            verdict=self.verdict,
            effects=tuple(item.read for item in self.effects),
            undecided=tuple(item.read for item in self.undecided),
            besides=tuple(item.read for item in self.besides),
            corrections=tuple(item.read for item in self.corrections),
            unsupported=tuple(item.read for item in self.unsupported),
            absorbed=self.absorbed,
            ranking=tuple(item.read for item in self.ranking),
            where=self.where.read,
            gap=self.gap.read,
            ambiguous=tuple(map(split_names, self.ambiguous)),
            experiment=self.experiment,
            hint=self.hint,
            checks=tuple(item.read for item in self.checks),
            notes=self.notes,
            nominal=values_of(self.parameters.nominal),
            fitted=values_of(self.parameters.fitted),
            seconds=self.seconds,
            flow_selection=None if flow is None else flow.read,
            discovered=None if term is None else term.read,
            findings=tuple(item.read for item in self.findings),
            with_term=values_of(self.parameters.with_term),
            provenance=self.provenance,
            refined_checks=tuple(item.read for item in self.refined_checks),
        )
