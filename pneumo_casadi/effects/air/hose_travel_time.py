"""Hose as a travel time: what the valve passes arrives later, and does not ring."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

from pneumo_casadi.effects.lags.transport_delay import (
    delay_rates,
    delay_rest,
    delay_states,
    delayed,
)
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter

TRAVEL_TIME = Parameter(
    "T",
    0.0,
    "s",
    lower=0.0,
    upper=0.06,
    scale=5e-3,
    null=0.0,
    start=5e-3,
    description="travel time of the air from the valve to the chamber",
    source="L/c, 2.9 (adiabatic) to 3.5 ms (at one temperature) a metre: 1.5-35 ms for 0.5-10 m",
)
#: A shorter hose is one of a third of a metre, or a matter of when samples were taken [s].
SHORTEST = 1e-3


class HoseTravelTime(Effect):
    r"""Flow that arrives at the chamber a travel time T after it has passed the valve.

    .. math:: q_{m}(t) = q_{valve}(t - T), \qquad T = L/c

    Without reflections: a long hose whose friction, or whose end, swallows the waves. The valve
    works against the pressure in the chamber, and a constant share of the flow that is lost on the
    way belongs to the flow map. T is approximated by two Padé sections, see `transport_delay`.
    """

    name = "hose_travel_time"
    cause = "hose"
    equation = "q_m(t) = q_valve(t − T), T = L/c"
    source = "Richer and Hurmuzlu (2000), J. Dyn. Syst. Meas. Control 122, eq. 29 and 30"
    shows = "both mass flow balances: the same flow, late"
    confused_with = ("hose", "valve_dynamics", "position_delay", "pressure_sensor_lag")
    flow_delays: ClassVar[tuple[str, ...]] = ("T",)
    one_form: ClassVar[bool] = True  # waves, or a volume, are other forms of a hose
    separated_by = "commands held while the piston moves: the flow follows the pressure late"
    parameters: ClassVar[tuple[Parameter, ...]] = (TRAVEL_TIME,)
    states = delay_states("kg/s", "kg/s2", 5e-3)

    @classmethod
    def credible_at(cls, values: Mapping[str, float]) -> Mapping[str, tuple[float, float]]:
        """Return the range of the longest travel time."""
        name = max(values, key=lambda each: values[each])
        return {name: (SHORTEST, TRAVEL_TIME.upper)}

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with a steady flow."""
        return delay_rest(entering["line"])

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Move the flow along the hose."""
        return delay_rates(entering["line"], self.times(at), at)

    def line(self, q_m: Pair, at: Scope) -> Pair:
        """Return the flow that arrives."""
        return delayed(q_m, self.times(at), at)

    def times(self, at: Scope) -> Pair:
        """Return the travel time to each chamber [s]."""
        return Pair(at["T"], at["T"])


class HoseTravelTimePerChamber(HoseTravelTime):
    """Travel times T_P and T_N: the valve sits nearer to one end. One hose may be missing."""

    name = "hose_travel_time_per_chamber"
    cause = "hose"
    equation = "q_m(t) = q_valve(t − T_c) of each chamber c"
    generalises = "hose_travel_time"
    flow_delays = ("T_P", "T_N")
    parameters = tuple(
        replace(TRAVEL_TIME, name=f"T_{c}", description=f"travel time to chamber {c}") for c in "PN"
    )

    def times(self, at: Scope) -> Pair:
        """Return the travel time to each chamber [s]."""
        return Pair(at["T_P"], at["T_N"])
