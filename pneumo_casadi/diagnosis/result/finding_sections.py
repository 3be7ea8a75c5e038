"""Effects, candidates, places, gaps and checks as they stand in `diagnosis.json`, typed."""

from collections.abc import Mapping
from dataclasses import replace
from math import inf, nan
from typing import Any

import msgspec

from pneumo_casadi.data import Finding, Grade
from pneumo_casadi.diagnosis.metrics.findings import (
    Candidate,
    Check,
    Closure,
    EffectFound,
    Gap,
    SensorError,
    Value,
    Where,
    split_names,
)
from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.diagnosis.metrics.regime import Condition, Regime, RegimeKind
from pneumo_casadi.errors import CaseError
from pneumo_casadi.model.junctions import Junction
from pneumo_casadi.runtime.json_input import Section


class ValueSection(Section):
    """A quantity; `std` is null where there is no interval."""

    value: float
    unit: str
    std: float | None = None
    at_bound: bool = False

    @property
    def read(self) -> Value:
        """The quantity."""
        std = nan if self.std is None else self.std
        return Value(self.value, std, self.unit, self.at_bound)


class EffectSection(Section):
    """An effect of the final model."""

    name: str
    form: str
    forms: dict[str, float]
    rivals: dict[str, float]
    probability: float
    contribution: float
    parameters: dict[str, ValueSection]

    @property
    def read(self) -> EffectFound:
        """The effect."""
        return EffectFound(
            self.name, self.probability, values_of(self.parameters), self.contribution,
            self.form, self.forms, self.rivals,
        )  # fmt: skip


class CandidateSection(Section):
    """A line of the ranking."""

    name: str
    probability: float
    held_out_shrink: float | None
    shrink_interval: tuple[float, float] | None
    explained: float
    observable: float
    parameters: dict[str, ValueSection]
    failure: str | None = None

    @property
    def read(self) -> Candidate:
        """The candidate."""
        closure = None
        if self.held_out_shrink is not None and self.shrink_interval is not None:
            closure = Closure(self.held_out_shrink, *self.shrink_interval)
        return Candidate(
            split_names(self.name), self.probability, closure, self.explained, self.observable,
            values_of(self.parameters), self.failure or "",
        )  # fmt: skip


class SensorErrorSection(Section):
    """A sensor error that could explain the residuals."""

    sensor: str
    explained: float


class ConditionSection(Section):
    """A condition; a bound that is null is infinite."""

    kind: str
    lower: float | None
    upper: float | None
    chamber: str


class RegimeSection(Section):
    """A part of the record in which the residual is large."""

    condition: ConditionSection
    balance: Location
    share: float
    time: float
    p_value: float

    @property
    def read(self) -> Regime:
        """The regime."""
        plain = self.condition
        try:
            kind = RegimeKind[plain.kind.upper()]
        except KeyError:
            raise CaseError(f"`where.regime_details`: no condition {plain.kind!r}") from None
        lower = -inf if plain.lower is None else plain.lower
        upper = inf if plain.upper is None else plain.upper
        condition = Condition(kind, lower, upper, plain.chamber)
        return Regime(condition, self.balance, self.share, self.time, self.p_value)


class WhereSection(Section):
    """Where simulation and measurement disagree."""

    balance: Location
    junction: str
    regime_details: tuple[RegimeSection, ...]
    shares: dict[str, float]
    unknown_inputs: dict[str, float]
    sensor_error: SensorErrorSection | None
    effects: tuple[str, ...]
    rivals: tuple[str, ...]
    balances: tuple[Location, ...] = ()
    sizes: dict[str, dict[str, float]] = msgspec.field(default_factory=dict)
    in_parameters: bool = False

    @property
    def read(self) -> Where:
        """The location."""
        sensor = self.sensor_error
        return Where(
            self.balance,
            Junction(self.junction) if self.junction else None,
            tuple(regime.read for regime in self.regime_details),
            self.shares,
            self.rivals,
            self.unknown_inputs,
            None if sensor is None else SensorError(sensor.sensor, sensor.explained),
            self.effects,
            self.balances,
            self.sizes,
            self.in_parameters,
        )


class GapSection(Section):
    """The held-out gap."""

    before: float
    after: float
    noise_floor: float
    shrink: float
    shrink_interval: tuple[float, float]
    views: dict[str, dict[str, dict[str, float | None]]]
    with_term: float | None = None

    @property
    def read(self) -> Gap:
        """The gap; what is null was not finite."""
        views = {
            view: {
                name: {key: nan if value is None else value for key, value in values.items()}
                for name, values in outputs.items()
            }
            for view, outputs in self.views.items()
        }
        closure = Closure(self.shrink, *self.shrink_interval)
        return Gap(self.before, self.after, self.noise_floor, closure, views, self.with_term)


class CheckSection(Section):
    """A parameter held against geometry or data sheet."""

    name: str
    value: float
    std: float | None
    expected: float
    tolerance: float
    unit: str
    agrees: bool
    text: str
    decisive: bool = True

    @property
    def read(self) -> Check:
        """The check."""
        std = nan if self.std is None else self.std
        return Check(
            self.name, self.value, std, self.expected, self.tolerance, self.unit, self.agrees,
            self.text, self.decisive,
        )  # fmt: skip


class FindingSection(Section):
    """A severe finding of the check of the records."""

    grade: Grade
    name: str
    about: str
    text: str
    file: str | None
    suggestion: dict[str, Any]
    source: str = ""

    @property
    def read(self) -> Finding:
        """The finding, whose text is stored with its source and its entries."""
        empty = Finding(
            self.grade, self.name, self.about, "", self.file or "", self.suggestion, self.source
        )
        start = f"{self.source}: " if self.source else ""
        end = empty.sentence.removeprefix(start)
        return replace(empty, text=self.text.removeprefix(start).removesuffix(end))


def values_of(sections: Mapping[str, ValueSection]) -> dict[str, Value]:
    """Return quantities by name."""
    return {name: section.read for name, section in sections.items()}
