"""Valve null shift: the command at which a valve is closed is not zero."""

from pneumo_casadi.effects.common.null_offsets import CONFUSED_WITH, OFFSETS
from pneumo_casadi.model.absorption import Absorption
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Pair


class ValveNullShift(Effect):
    """Offset of each valve's opening."""

    name = "valve_null_shift"
    absorbed_by = Absorption(("flow map", "flow scale"))
    equation = "u_P −→ u_P + u_0P, u_N −→ u_N + u_0N"
    source = "centring of spools and drift of their amplifiers, data sheets"
    shows = "mass flow balance of a chamber, constant in the command"
    confused_with = CONFUSED_WITH
    separated_by = "close one valve after the other at several pressures: a leak goes with pressure"
    one_form = True
    parameters = OFFSETS

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Shift the opening."""
        return Pair(u.P + at["u_0P"], u.N + at["u_0N"])
