"""What a diagnosis tells of a discovered term."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from pneumo_casadi.diagnosis.metrics.findings import Closure, Value
from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.effects.term import Term
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import FloatArray

#: Standard deviations from the estimate to an end of the 95 % interval.
QUANTILE = 1.96


@dataclass(frozen=True, eq=False)
class TermCurve:
    """The term as a smooth curve, which assumes no formula.

    Parameters
    ----------
    driver : (n,) array
        Values of the driver [SI]; of a formula that repeats, over one period.
    value, band : (n,) array
        Curve, and half the width of its 95 % band, in the unit of the term.
    formula : (n,) array
        The formula there, less what the parameters of the model take up alike.
    """

    driver: FloatArray
    value: FloatArray
    band: FloatArray
    formula: FloatArray


def causes_in(effects: Iterable[Effect]) -> tuple[str, ...]:
    """Return the causes of effects, whatever their forms, each once."""
    return tuple(dict.fromkeys(effect.cause for effect in effects))


@dataclass(frozen=True, eq=False)
class DiscoveredTerm:
    """A term outside the catalogue that closes a part of the gap.

    Parameters
    ----------
    term : Term
        Balance, factor, driver, formula and its parameters.
    std : mapping of str to float
        Robust standard deviations of the parameters [SI]; 0 where one was held.
    closes : Closure
        Of the held-out gap of the balances, over the model `beside` without the term.
    beside : tuple of str
        Causes of the catalogue in the model to which the term was added.
    curve : TermCurve
        The term without a formula.
    """

    term: Term
    std: Mapping[str, float]
    closes: Closure
    beside: tuple[str, ...]
    curve: TermCurve

    @property
    def locations(self) -> tuple[Location, ...]:
        """Balances in which the term acts, or what the sensors show."""
        if self.term.balances[0].startswith("measurement"):
            return (Location.MEASUREMENT,)
        return tuple(Location(name) for name in self.term.balances)

    @property
    def balance(self) -> str:
        """The same in words: ``force``, ``mass_flow_P + mass_flow_N``, ``measurement`` ..."""
        return " + ".join(self.locations)

    @property
    def parameters(self) -> dict[str, Value]:
        """Parameters of the formula with standard deviation and unit."""
        units = self.term.units
        return {
            name: Value(value, self.std.get(name, 0.0), units[name])
            for name, value in self.term.parameters.items()
        }

    def as_dict(self) -> dict[str, Any]:
        """Return the term as plain data."""
        return {
            "balance": self.balance,
            "factor": self.term.factor,
            "driver": self.term.driver,
            "form": self.term.formula,
            "formula": self.term.expression,
            "parameters": {
                name: {
                    "value": item.value,
                    "std": item.std,
                    "interval": [
                        item.value - QUANTILE * item.std,
                        item.value + QUANTILE * item.std,
                    ],
                    "unit": item.unit,
                }
                for name, item in self.parameters.items()
            },
            "closes": {
                "value": self.closes.value,
                "interval": [self.closes.lower, self.closes.upper],
            },
            "beside": list(self.beside),
        }
