"""Valve null shift that settles while the coil warms."""

from collections.abc import Mapping
from typing import Any

from pneumo_casadi.effects.common.null_offsets import CONFUSED_WITH, OFFSETS
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter


class ValveNullShiftWarming(Effect):
    """Offset of each valve's opening that settles from the start of the record on."""

    name = "valve_null_shift_warming"
    cause = "valve_null_shift"
    equation = "u −→ u + u_0 (1 − a c), τ ċ = −c, c = 1 at the start of a record"
    source = "zero drift of the spool's amplifier over temperature, data sheets"
    shows = "mass flow balance of a chamber, most at the start of a record"
    confused_with = CONFUSED_WITH
    separated_by = "the same motion with a cold and with a warm valve"
    one_form = True
    parameters = (
        *OFFSETS,
        Parameter(
            "a",
            0.0,
            "1",
            lower=-1.0,
            upper=1.0,
            scale=0.5,
            null=0.0,
            start=0.1,
            description="share of the offset that is not there at the start of a record",
            source="a tenth to a half, by the temperature of the amplifier",
        ),
        Parameter(
            "tau",
            5.0,
            "s",
            lower=0.5,
            upper=200.0,
            scale=20.0,
            null=5.0,
            description="time constant of warming",
            source="seconds for a coil, minutes for a housing",
        ),
    )
    states = (State("c", "1"),)

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start cold."""
        return {"c": 1.0}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Let the valve warm."""
        return {"c": -at["c"] / at["tau"]}

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Shift the opening."""
        settled = 1 - at["a"] * at["c"]
        return Pair(u.P + at["u_0P"] * settled, u.N + at["u_0N"] * settled)
