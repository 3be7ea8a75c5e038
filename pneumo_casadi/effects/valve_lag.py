"""Valve lag: the spool follows the command with a delay of first order."""

from collections.abc import Mapping
from typing import Any

from pneumo_casadi.effect import Effect, Expression, Pair, Scope, State
from pneumo_casadi.effects.regular_lag import lag_rate, lagged
from pneumo_casadi.parameters import Parameter


class ValveLag(Effect):
    """First-order spool on both valves.

    Spool over command is (1 + τ₀ s) / (1 + (τ₀ + τ) s) with τ₀ = 1 ms, which is a lag of time
    constant τ below 1/τ₀ and exactly one at τ = 0.
    """

    name = "valve_lag"
    equation = "τ u̇_s + u_s = u, for both spools"
    source = "first-order part of `valve_dynamics`"
    shows = "mass flow balances, when the command changes fast"
    confused_with = ("valve_dynamics", "hose", "position_delay", "pressure_sensor_lag")
    separated_by = "a multisine of the command up to the bandwidth of the spool"
    parameters = (
        Parameter(
            "tau",
            0.0,
            "s",
            lower=0.0,
            upper=0.2,
            scale=5e-3,
            null=0.0,
            start=3e-3,
            description="time constant of the spool beyond the command",
            source="bandwidth of 5-250 Hz for proportional spool valves",
        ),
    )
    states = (State("u_P", "V", 1.0), State("u_N", "V", 1.0))

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the spool where the command holds it."""
        return {"u_P": entering["spool"].P, "u_N": entering["spool"].N}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Let the state follow the command."""
        u = entering["spool"]
        return {
            "u_P": lag_rate(u.P, at["u_P"], at["tau"]),
            "u_N": lag_rate(u.N, at["u_N"], at["tau"]),
        }

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Let the spool come late."""
        return Pair(lagged(u.P, at["u_P"], at["tau"]), lagged(u.N, at["u_N"], at["tau"]))
