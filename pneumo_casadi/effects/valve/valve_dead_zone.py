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

#: What both forms of a dead zone declare.
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
        return Pair(_beyond(u.P, at["delta"]), _beyond(u.N, at["delta"]))


class ValveDeadZonePerValve(ValveDeadZone):
    """Overlap that differs from one valve to the other: one is worn, or of another maker."""

    name = "valve_dead_zone_per_valve"
    cause = "valve_dead_zone"
    equation = "u_c −→ u_c + (√((u_c − δ_c)² + w²) − √((u_c + δ_c)² + w²))/2 of each valve c"
    generalises = "valve_dead_zone"
    scanned = MappingProxyType({f"delta_{c}": (0.0, 0.1, 0.3) for c in "PN"})
    parameters = tuple(
        replace(DELTA, name=f"delta_{c}", description=f"half the width of the zone of valve {c}")
        for c in "PN"
    )

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Take the dead zone of each valve from its opening."""
        return Pair(_beyond(u.P, at["delta_P"]), _beyond(u.N, at["delta_N"]))


def _beyond(u: Expression, delta: Expression) -> Expression:
    above, below = (ca.sqrt((u - side * delta) ** 2 + ROUNDING**2) for side in (1, -1))
    return u + (above - below) / 2
