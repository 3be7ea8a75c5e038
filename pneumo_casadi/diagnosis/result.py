"""What a diagnosis says: the verdict, its reasons, and how far the gap closes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # it is made of what this module defines
    from pneumo_casadi.diagnosis.evidence import Evidence


class Verdict(Enum):
    """What may be said of a case."""

    EFFECT = "effect"
    """One effect, or several together, close the gap, and no other explains it as well."""
    AMBIGUOUS = "ambiguous"
    """Several effects close the gap alike: the data cannot tell them apart."""
    ABSORBED = "absorbed"
    """No gap in trajectories, but parameters that contradict geometry or data sheet."""
    UNKNOWN = "unknown"
    """A gap that nothing in the catalogue closes."""
    NONE = "none"
    """No gap that matters."""


@dataclass(frozen=True, slots=True)
class Value:
    """A quantity with its standard deviation, in `unit`.

    Parameters
    ----------
    value, std : float
        Estimate and standard deviation, in `unit`; 0 where it was held.
    unit : str
        SI unit.
    """

    value: float
    std: float
    unit: str


@dataclass(frozen=True, slots=True)
class Shrink:
    """How far a gap closes: 1 - after/before, with an interval from a block bootstrap.

    Parameters
    ----------
    value : float
        Share of the gap that closes [1]; negative where it grows.
    lower, upper : float
        Ends of the 95 % interval [1].
    """

    value: float
    lower: float
    upper: float


@dataclass(frozen=True, slots=True)
class EffectFound:
    """An effect that was added to the model.

    Parameters
    ----------
    name : str
        In the catalogue.
    probability : float
        That it is part of the cause.
    parameters : mapping of str to Value
        Its own parameters as fitted, by their short names.
    """

    name: str
    probability: float
    parameters: Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class Candidate:
    """One line of the ranking: an effect, or several joined by ``+``.

    Parameters
    ----------
    names : tuple of str
        Effects in the order in which they were added.
    probability : float
        That these and no others are the cause.
    shrink : Shrink or None
        Of the held-out gap in the balances; None where the fit failed.
    explained : float
        Share of the squared residuals that the screen promises, 0 to 1.
    observable : float
        Share of the effect's influence that no refit of the nominal model takes up, 0 to 1.
    parameters : mapping of str to Value
        As fitted.
    failure : str
        Why there is no fit; empty where there is one.
    """

    names: tuple[str, ...]
    probability: float
    shrink: Shrink | None
    explained: float
    observable: float
    parameters: Mapping[str, Value] = field(default_factory=dict)
    failure: str = ""

    @property
    def label(self) -> str:
        """The names joined by a plus."""
        return " + ".join(self.names)


@dataclass(frozen=True, slots=True)
class Regime:
    """A part of the record in which the gap is larger or smaller than elsewhere.

    Parameters
    ----------
    name : str
        In words: ``"near standstill"``, ``"u < 0"``, ``"while chamber P fills"``.
    balance : str
        Where: ``mass_flow_P``, ``mass_flow_N`` or ``force``.
    share : float
        Of that balance's squared residual.
    time : float
        Share of the record spent there.
    p_value : float
        Chance of such a difference, residuals shuffled in blocks.
    """

    name: str
    balance: str
    share: float
    time: float
    p_value: float

    @property
    def ratio(self) -> float:
        """Mean square there over the mean square everywhere."""
        return self.share / self.time if self.time > 0 else 0.0


@dataclass(frozen=True, slots=True)
class Where:
    """Where simulation and reality part.

    Parameters
    ----------
    balance : str
        ``mass_flow_P``, ``mass_flow_N``, ``force``, ``measurement``, or ``none``.
    junction : str
        Of the effect found, or that which the regimes point to; empty if none.
    regimes : tuple of Regime
        The most telling ones, the strongest first.
    shares : mapping of str to float
        Energy of the unknown input in each balance, in units of its noise floor, as shares.
    rivals : tuple of str
        Sensor effects that could look the same.
    words : tuple of str
        Sentences for a reader.
    """

    balance: str
    junction: str
    regimes: tuple[Regime, ...]
    shares: Mapping[str, float]
    rivals: tuple[str, ...]
    words: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Gap:
    """The held-out gap, before and after, in per cent of the signals.

    Parameters
    ----------
    before, after : float
        Root mean square over the outputs of what lies above the noise floor, open loop in
        windows of half a second.
    noise_floor : float
        What the sensors' noise alone leaves.
    shrink : Shrink
        Of this gap.
    views : mapping of str to mapping of str to mapping of str to float
        The same by view (``windows``, ``closed_loop``, ``balances``) and output or balance:
        ``before``, ``after``, ``noise``.
    """

    before: float
    after: float
    noise_floor: float
    shrink: Shrink
    views: Mapping[str, Mapping[str, Mapping[str, float]]]


@dataclass(frozen=True, slots=True)
class Check:
    """A parameter held against geometry or data sheet.

    Parameters
    ----------
    name : str
        ``S_P``, ``S_N``, ``k_P``, ``k_N``, ``M``, ``flow map`` ...
    value, std, expected, tolerance : float
        Found, and what it should be within, in `unit`.
    unit : str
        SI unit.
    agrees : bool
        Whether it does.
    text : str
        In words.
    """

    name: str
    value: float
    std: float
    expected: float
    tolerance: float
    unit: str
    agrees: bool
    text: str


@dataclass(frozen=True, eq=False)
class Diagnosis:
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
    ambiguous : tuple of str
        Names that the data cannot tell apart, the most probable first.
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
    """

    case: str
    verdict: Verdict
    effects: tuple[EffectFound, ...]
    ranking: tuple[Candidate, ...]
    where: Where
    gap: Gap
    ambiguous: tuple[str, ...]
    experiment: str
    hint: str
    checks: tuple[Check, ...]
    notes: tuple[str, ...]
    nominal: Mapping[str, Value]
    fitted: Mapping[str, Value]
    seconds: float
    evidence: "Evidence | None" = None

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain data, the keys of the design first."""
        shrink = self.gap.shrink
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
                    "held_out_shrink": None if one.shrink is None else one.shrink.value,
                    "shrink_interval": (
                        None if one.shrink is None else [one.shrink.lower, one.shrink.upper]
                    ),
                    "explained": one.explained,
                    "observable": one.observable,
                    "parameters": _values(one.parameters),
                    "failure": one.failure or None,
                }
                for one in self.ranking
            ],
            "where": {
                "balance": self.where.balance,
                "junction": self.where.junction,
                "regimes": [one.name for one in self.where.regimes],
                "regime_details": [
                    {
                        "name": one.name,
                        "balance": one.balance,
                        "share": one.share,
                        "time": one.time,
                        "p_value": one.p_value,
                    }
                    for one in self.where.regimes
                ],
                "shares": dict(self.where.shares),
                "rivals": list(self.where.rivals),
                "words": list(self.where.words),
            },
            "gap": {
                "before": self.gap.before,
                "after": self.gap.after,
                "noise_floor": self.gap.noise_floor,
                "shrink": shrink.value,
                "shrink_interval": [shrink.lower, shrink.upper],
                "views": {
                    view: {name: dict(values) for name, values in outputs.items()}
                    for view, outputs in self.gap.views.items()
                },
            },
            "ambiguous": list(self.ambiguous),
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
            "case": self.case,
            "seconds": self.seconds,
        }


def _values(values: Mapping[str, Value]) -> dict[str, dict[str, Any]]:
    return {
        name: {"value": one.value, "std": one.std, "unit": one.unit} for name, one in values.items()
    }
