"""Valve dead zone whose two edges differ, and open gradually."""

import casadi as ca

from pneumo_casadi.effects.valve.valve_dead_zone import CONFUSED_WITH, DELTA, SCANNED, SEPARATED_BY
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter


class ValveDeadZoneEdges(Effect):
    """Overlap of each edge of its own, and edges that open over a width of the command.

    With s(x) = (x + √(x² + w²))/2, the opening is s(u − δ₊) − s(−u − δ₋), δ± = δ (1 ± e). At δ = 0
    it is exactly u for any e and w. Beside a dead zone of even edges, a shifted null opens the
    valve within the zone; uneven edges leave it closed.
    """

    name = "valve_dead_zone_edges"
    cause = "valve_dead_zone"
    equation = "u −→ s(u − δ₊) − s(−u − δ₋), s(x) = (x + √(x² + w²))/2, δ± = δ (1 ± e)"
    source = "tolerances of spool and sleeve; notches and rounding of control edges, data sheets"
    shows = "both mass flow balances around u = 0; limit cycles and offsets in closed loop"
    confused_with = CONFUSED_WITH
    separated_by = SEPARATED_BY
    scanned = SCANNED
    parameters = (
        DELTA,
        Parameter(
            "e",
            0.0,
            "1",
            lower=-0.9,
            upper=0.9,
            scale=0.1,
            null=0.0,
            start=0.0,
            description="by what share of δ the supply edge overlaps more, the exhaust edge less",
            source="a tenth for edges ground to fit, more in cheap valves; engineering judgement",
        ),
        Parameter(
            "w",
            0.02,
            "V",
            lower=0.002,
            upper=1.0,
            scale=0.02,
            null=0.02,
            start=0.02,
            description="width over which an edge opens",
            source="rounded edges and notches: up to the overlap itself",
        ),
    )

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Take from the opening what each edge overlaps."""
        return Pair(_open(u.P, at), _open(u.N, at))


def _open(u: Expression, at: Scope) -> Expression:
    delta, e, w = at["delta"], at["e"], at["w"]
    above = ca.sqrt((u - delta * (1 + e)) ** 2 + w**2)
    below = ca.sqrt((u + delta * (1 - e)) ** 2 + w**2)
    return u - delta * e + (above - below) / 2
