"""Regimes: conditions under which a balance fails more than elsewhere."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from math import inf, isinf

from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.model.junctions import Junction


class RegimeKind(Enum):
    """What a regime is a condition on; bounds are in SI units."""

    STANDSTILL = "near standstill (|v| < {upper_mm:.0f} mm/s)"
    SLOW = "slow motion (|v| < {upper_mm:.0f} mm/s)"
    FAST = "fast motion (|v| > {lower_mm:.0f} mm/s)"
    FORWARD = "moving in +x"
    BACKWARD = "moving in −x"
    LOWER_THIRD = "lower third of the travel"
    MIDDLE_THIRD = "middle third of the travel"
    UPPER_THIRD = "upper third of the travel"
    TRAVEL_ENDS = "near the ends of the travel"
    AFTER_REVERSAL = "within {upper_mm:.0f} ms after a reversal"
    FIRST_THIRD = "first third of the record"
    LAST_THIRD = "last third of the record"
    HIGH_PRESSURES = "high pressures in both chambers"
    LOW_PRESSURES = "low pressures in both chambers"
    FILLING = "valve {chamber} filling (u > 0)"
    EMPTYING = "valve {chamber} emptying (u < 0)"
    NEAR_NULL = "valve {chamber} near null (|u| < {upper:.2g} V)"
    HALF_OPEN = "valve {chamber} half open ({lower:.2g} V < |u| < {upper:.2g} V)"
    WIDE_OPEN = "valve {chamber} wide open (|u| > {lower:.2g} V)"
    PRESSURE_RISING = "pressure {chamber} rising"
    PRESSURE_FALLING = "pressure {chamber} falling"
    CHOKED_INFLOW = "choked flow into chamber {chamber}"
    UNCHOKED_INFLOW = "flow into chamber {chamber}, not choked"
    CHOKED_OUTFLOW = "choked flow out of chamber {chamber}"
    UNCHOKED_OUTFLOW = "flow out of chamber {chamber}, not choked"
    BAND = "between {lower:g} and {upper:g} Hz"

    @property
    def junction(self) -> Junction | None:
        """The junction that the regime points to; None if to none."""
        return _JUNCTIONS.get(self)


_JUNCTIONS: Mapping[RegimeKind, Junction] = {
    RegimeKind.NEAR_NULL: Junction.SPOOL,
    RegimeKind.FILLING: Junction.SUPPLY,
    RegimeKind.CHOKED_INFLOW: Junction.SUPPLY,
    RegimeKind.UNCHOKED_INFLOW: Junction.SUPPLY,
    RegimeKind.EMPTYING: Junction.OUTLET,
    RegimeKind.CHOKED_OUTFLOW: Junction.OUTLET,
    RegimeKind.UNCHOKED_OUTFLOW: Junction.OUTLET,
}


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition that holds during a part of a record.

    Parameters
    ----------
    kind : RegimeKind
        What it is a condition on.
    lower, upper : float
        Bounds of speed [m/s], time after a reversal [s], command [V] or frequency [Hz]; infinite
        where there is none.
    chamber : str
        ``"P"``, ``"N"``, or empty.

    Examples
    --------
    >>> Condition(RegimeKind.NEAR_NULL, upper=0.25, chamber="P").text
    'valve P near null (|u| < 0.25 V)'
    >>> Condition(RegimeKind.BAND, lower=8.0).text
    'above 8 Hz'
    """

    kind: RegimeKind
    lower: float = -inf
    upper: float = inf
    chamber: str = ""

    @property
    def text(self) -> str:
        """The condition in words, as JSON results name it."""
        if self.kind is RegimeKind.BAND and isinf(self.upper):
            return f"above {self.lower:g} Hz"
        return self.kind.value.format(
            lower=self.lower,
            upper=self.upper,
            lower_mm=1e3 * self.lower,
            upper_mm=1e3 * self.upper,
            chamber=self.chamber,
        )


@dataclass(frozen=True, slots=True)
class Regime:
    """A part of the record in which the gap is larger or smaller than elsewhere.

    Parameters
    ----------
    condition : Condition
        When.
    balance : Location
        Which balance fails.
    share : float
        Of that balance's squared residual.
    time : float
        Share of the record spent there; of a frequency band, the share of the balance's signal.
    p_value : float
        Probability of such a difference if residuals are shuffled in blocks.
    """

    condition: Condition
    balance: Location
    share: float
    time: float
    p_value: float

    @property
    def name(self) -> str:
        """The condition in words."""
        return self.condition.text

    @property
    def ratio(self) -> float:
        """Mean square there over the mean square everywhere."""
        return self.share / self.time if self.time > 0 else 0.0
