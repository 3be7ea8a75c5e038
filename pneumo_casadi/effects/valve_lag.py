"""Valve lag: the spool follows the command with a delay of first order."""

from collections.abc import Mapping
from typing import Any

from pneumo_casadi.effect import Effect, Expression, Pair, Scope, State
from pneumo_casadi.parameters import Parameter

#: Time constant of the numerator [s]. It keeps the null value regular: at tau = 0 pole and
#: zero cancel, the axis is the nominal one, and the derivative to tau is that of a true lag.
TAU_REGULAR = 1e-3


class ValveLag(Effect):
    """First-order spool on both valves.

    Spool over command is (1 + τ₀ s) / (1 + (τ₀ + τ) s) with τ₀ = 1 ms, which is a lag of time
    constant τ below 1/τ₀ and exactly one at τ = 0.
    """

    name = "valve_lag"
    parameters = (
        Parameter(
            "tau",
            0.0,
            "s",
            lower=0.0,
            upper=0.2,
            scale=5e-3,
            null=0.0,
            description="time constant of the spool beyond the command",
            source="bandwidth of 5-250 Hz for proportional spool valves",
        ),
    )
    states = (State("u_P", "V", 1.0), State("u_N", "V", 1.0))

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the spool where the command holds it."""
        return {"u_P": entering["spool"].P, "u_N": entering["spool"].N}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Let the state follow the command with time constant τ₀ + τ."""
        u = entering["spool"]
        total = TAU_REGULAR + at["tau"]
        return {"u_P": (u.P - at["u_P"]) / total, "u_N": (u.N - at["u_N"]) / total}

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Blend command and state so that numerator and denominator cancel at τ = 0."""
        share = at["tau"] / (TAU_REGULAR + at["tau"])
        return Pair(u.P - share * (u.P - at["u_P"]), u.N - share * (u.N - at["u_N"]))
