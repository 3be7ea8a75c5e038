"""Valve hysteresis: play between command and spool."""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from pneumo_casadi.effect import Effect, Expression, Pair, Scope, State
from pneumo_casadi.parameters import Parameter

#: Time in which the memory of the play follows the command [s].
TAU_MEMORY = 1e-3


class ValveHysteresis(Effect):
    """Play of half-width h on the command of each valve.

    The spool is the memory z, kept within h of the command: w = u + clip(z − u, −h, h). The
    memory is drawn along by whatever the clip cuts off, ż = −(z − w)/τ with τ = 1 ms, and stays
    where it is inside the play. At h = 0 the spool is the command, exactly, and because z lags
    behind u the derivative to h is −sign(u̇), that of true play.
    """

    name = "valve_hysteresis"
    equation = "w = u + clip(z − u, −h, h), ż = −(z − w)/τ"
    source = "play operator, Visintin (1994), Differential Models of Hysteresis; valve data sheets"
    shows = "both mass flow balances at reversals of the command, the same at every frequency"
    confused_with = ("valve_dynamics", "valve_dead_zone", "position_delay", "valve_null_shift")
    separated_by = "slow sines of several amplitudes: play is a phase lag that falls with amplitude"
    parameters = (
        Parameter(
            "h",
            0.0,
            "V",
            lower=0.0,
            upper=1.0,
            scale=0.05,
            null=0.0,
            start=0.05,
            description="half the width of the play",
            source="0.2-3 % of the command range",
        ),
    )
    states = (State("z_P", "V"), State("z_N", "V"))

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start in the middle of the play."""
        return {"z_P": entering["spool"].P, "z_N": entering["spool"].N}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Draw the memory along where the command has left the play."""
        u = entering["spool"]
        return {
            "z_P": (_within(u.P, at["z_P"], at["h"]) - at["z_P"]) / TAU_MEMORY,
            "z_N": (_within(u.N, at["z_N"], at["h"]) - at["z_N"]) / TAU_MEMORY,
        }

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Hold the spool within the play."""
        return Pair(_within(u.P, at["z_P"], at["h"]), _within(u.N, at["z_N"], at["h"]))


def _within(u: Expression, z: Expression, h: Expression) -> Expression:
    # As a sum, the clip has a derivative to h where h is zero; nested, it would be a tie.
    e = z - u
    return u + (e - ca.fmax(e - h, 0.0) + ca.fmax(-e - h, 0.0))
