"""Valve stiction: a spool that sticks until the command has left it far enough, and then jumps."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import casadi as ca

from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter

#: Ratio of two thresholds that are tried one after the other, and how many of them.
RATIO, COUNT = 1.01, 560
#: Ratios of a threshold that are tried near one, starts all over the range, and near one.
NEAR = tuple(1.001**i for i in range(-30, 31))
STARTS = tuple(i / 20 for i in range(-20, 21))
NEAR_START = tuple(i / 400 for i in range(-24, 25))


class ValveStiction(Effect):
    """A spool that sticks: it stays where it is until the command is h away, then goes there.

    The spool s of each valve moves from sample to sample, at which the command changes::

        s = u where |u − s⁻| > h, else s⁻

    with s⁻ from the sample before. Between two commands nothing breaks it away, so that this is
    exact for a command that is held. At h = 0 the spool position is exactly the command.

    A small change of h moves no jump, and then one of them: the cost over h is a staircase with a
    narrow valley. Where a record begins, the spool is z h off the command. Two spools that begin
    apart only meet when both jump at one sample, which can take a whole record. All records are
    taken to begin alike, as those do that begin with the axis at rest at one place; where a record
    was cut in motion, the spool is wrong until the two have met. Only a diagnosis finds h and z:
    elsewhere they are held at what is given. They belong to the sampling rate of the commands.
    """

    name = "valve_stiction"
    cause = "valve_hysteresis"
    equation = "s = u where |u − s⁻| > h, else s⁻; s⁻ from the sample before"
    source = "stick-slip of control valves, Stenman, Gustafsson, Forsman (2003)"
    shows = "both mass flow balances: the spool moves in jumps of h, also without a reversal"
    confused_with = ("valve_dynamics", "valve_dead_zone", "position_delay", "valve_null_shift")
    separated_by = "a slow ramp of the command: the flow rises in stairs, with play it is smooth"
    parameters = (
        Parameter(
            "h",
            0.0,
            "V",
            lower=0.0,
            upper=1.0,
            scale=0.05,
            free=False,
            null=0.0,
            start=0.05,
            description="how far the command must be from the spool to break it away",
            source="0.2-3 % of the command range",
        ),
        *(
            Parameter(
                f"z_{c}",
                0.0,
                "1",
                lower=-1.0,
                upper=1.0,
                scale=0.1,
                free=False,
                null=0.0,
                start=0.0,
                description=f"offset of valve {c}'s spool where a record begins, over h",
                source="the spool may rest anywhere within h of the command",
            )
            for c in "PN"
        ),
    )
    scanned = MappingProxyType({"h": tuple(0.003 * RATIO**i for i in range(COUNT))})
    staircase = ("z_P", "z_N", "h")
    states = tuple(State(f"s_{c}", "V", sampled=True) for c in "PN")

    def stairs(self, values: Mapping[str, float]) -> dict[str, tuple[float, ...]]:
        """Return starts all over the range and near those given, and thresholds within 3 %."""
        near = tuple(min(values["h"] * ratio, 1.0) for ratio in NEAR)
        starts = {
            name: (*STARTS, *(min(max(values[name] + z, -1.0), 1.0) for z in NEAR_START))
            for name in ("z_P", "z_N")
        }
        return {**starts, "h": near}

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start where the records begin."""
        u = entering["command"]
        return {"s_P": u.P + at["z_P"] * at["h"], "s_N": u.N + at["z_N"] * at["h"]}

    def renewed(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Keep the spool where the command has brought it."""
        s = self.command(entering["command"], at)
        return {"s_P": s.P, "s_N": s.N}

    def command(self, u: Pair, at: Scope) -> Pair:
        """Leave the spool where it is, or let it jump to the command."""
        return Pair(
            *(
                ca.if_else(ca.fabs(command - at[f"s_{c}"]) > at["h"], command, at[f"s_{c}"])
                for c, command in zip("PN", u, strict=True)
            )
        )
