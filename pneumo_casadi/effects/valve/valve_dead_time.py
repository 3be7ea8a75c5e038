"""Dead time of the valve: its spool moves a while after the command has changed."""

from collections.abc import Mapping
from typing import Any

from pneumo_casadi.effects.lags.transport_delay import (
    delay_rates,
    delay_rest,
    delay_states,
    delayed,
)
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter


class ValveDeadTime(Effect):
    r"""Spools that do at t what was commanded at t − T.

    .. math:: u_{spool}(t) = u(t - T)

    A bus between controller and valve, the valve's own electronics, or a pilot stage. T is
    approximated by two Padé sections, see `transport_delay`.
    """

    name = "valve_dead_time"
    cause = "valve_dynamics"
    equation = "u_spool(t) = u(t − T)"
    source = "dead times in data sheets of valves; cycle times of field buses"
    shows = "both mass flow balances, in proportion to u̇: each change of the command, late"
    confused_with = ("valve_dynamics", "hose", "position_delay", "pressure_sensor_lag")
    separated_by = "steps of the command: dead time shifts the answer, a slow spool rounds it"
    command_delays = ("T",)
    parameters = (
        Parameter(
            "T",
            0.0,
            "s",
            lower=0.0,
            upper=0.06,
            scale=5e-3,
            null=0.0,
            start=5e-3,
            description="time from a command to the spool's answer",
            source="1-10 ms of a field bus or a pilot stage, up to 30 ms of a radio link",
        ),
    )
    states = delay_states("V", "V/s", 1.0)

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the spool where the command holds it."""
        return delay_rest(entering["spool"])

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Pass the command on."""
        return delay_rates(entering["spool"], (at["T"], at["T"]), at)

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Return the late command."""
        return delayed(u, (at["T"], at["T"]), at)
