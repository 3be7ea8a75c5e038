"""Valve dead zone: the spool must travel before an edge opens."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import ClassVar

import casadi as ca

from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter

#: Width over which an edge opens [V]; keeps derivatives smooth and cancels at a zone of zero.
ROUNDING = 0.002

#: Control edges: the valve, and the side of the command on which the edge opens.
EDGE_NAMES = {"plus": "supply", "minus": "exhaust"}
EDGES = tuple((c, side) for c in "PN" for side in EDGE_NAMES)
#: What all forms of a dead zone declare.
CONFUSED_WITH = (
    "valve_null_shift",
    "valve_hysteresis",
    "flow_map_shape",
    "stribeck",
    "F_c_plus",
)
SEPARATED_BY = "slow ramps of the command through zero, both ways, at held pressures"
#: Starts: a zone much wider than the first leads no step to it, the valve is open where it is shut.
SCANNED = MappingProxyType({"delta": (0.05, 0.1, 0.2, 0.4)})
DELTA = Parameter(
    "delta",
    0.0,
    "V",
    lower=0.0,
    upper=2.0,
    scale=0.05,
    null=0.0,
    start=0.1,
    description="half the width of the dead zone",
    source="1-5 % of the command range of valves with overlap",
)


class ValveDeadZone(Effect):
    """Overlap of both edges of both valves, rounded where they open.

    With s(x) = (x + √(x² + w²))/2, the opening is s(u − δ) − s(−u − δ): u − δ beyond δ, u + δ
    below −δ, and almost zero between. Because s(x) − s(−x) = x, it is exactly u at δ = 0 for any
    rounding w.
    """

    name = "valve_dead_zone"
    equation = "u −→ u + (√((u − δ)² + w²) − √((u + δ)² + w²))/2, w = 2 mV"
    source = "overlap of spool and port, data sheets of proportional valves"
    shows = "both mass flow balances around u = 0; limit cycles and offsets in closed loop"
    confused_with = CONFUSED_WITH
    separated_by = SEPARATED_BY
    scanned: ClassVar[Mapping[str, tuple[float, ...]]] = SCANNED
    parameters: ClassVar[tuple[Parameter, ...]] = (DELTA,)

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Take the dead zone from the opening."""
        return Pair(*(_beyond(each, at["delta"], at["delta"]) for each in (u.P, u.N)))


class ValveDeadZonePerEdge(ValveDeadZone):
    """Overlap of each edge of each valve: edges are worn, ground or shimmed one by one.

    With s as in `ValveDeadZone`, the opening of valve c is s(u_c − δ_c⁺) − s(−u_c − δ_c⁻).
    """

    name = "valve_dead_zone_per_edge"
    cause = "valve_dead_zone"
    equation = "u_c −→ s(u_c − δ_c⁺) − s(−u_c − δ_c⁻) of each valve c, s(x) = (x + √(x² + w²))/2"
    generalises = "valve_dead_zone"
    scanned = MappingProxyType({f"delta_{c}_{side}": (0.0, 0.1, 0.3) for c, side in EDGES})
    parameters = tuple(
        replace(
            DELTA,
            name=f"delta_{c}_{side}",
            description=f"overlap of the {EDGE_NAMES[side]} edge of valve {c}",
        )
        for c, side in EDGES
    )

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Take the overlap of each edge from the opening of its valve."""
        return Pair(
            _beyond(u.P, at["delta_P_plus"], at["delta_P_minus"]),
            _beyond(u.N, at["delta_N_plus"], at["delta_N_minus"]),
        )


def _beyond(u: Expression, plus: Expression, minus: Expression) -> Expression:
    above, below = (ca.sqrt((u - edge) ** 2 + ROUNDING**2) for edge in (plus, -minus))
    return u + (minus - plus + above - below) / 2
