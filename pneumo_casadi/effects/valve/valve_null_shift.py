"""Valve null shift: the command at which a valve is closed is not zero."""

from pneumo_casadi.model.absorption import Absorption
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Pair
from pneumo_casadi.parameters import Parameter


class ValveNullShift(Effect):
    """Offset of each valve's opening."""

    name = "valve_null_shift"
    absorbed_by = Absorption(("flow map", "flow scale"))
    equation = "u_P −→ u_P + u_0P, u_N −→ u_N + u_0N"
    source = "centring of spools and drift of their amplifiers, data sheets"
    shows = "mass flow balance of a chamber, constant in the command"
    confused_with = (
        "leakage_P",
        "leakage_N",
        "valve_dead_zone",
        "constant_force",
        "flow coefficients",
    )
    separated_by = "close one valve after the other at several pressures: a leak goes with pressure"
    one_form = True
    parameters = tuple(
        Parameter(
            f"u_0{c}",
            0.0,
            "V",
            lower=-1.0,
            upper=1.0,
            scale=0.05,
            null=0.0,
            start=start,
            description=f"opening of valve {c} at zero command",
            source="0.5-2 % of the command range",
        )
        for c, start in (("P", 0.05), ("N", -0.05))
    )

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Shift the opening."""
        return Pair(u.P + at["u_0P"], u.N + at["u_0N"])
