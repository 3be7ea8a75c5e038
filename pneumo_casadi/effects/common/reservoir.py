"""Reservoir from which the valves draw, behind a regulator: what the forms of droop share."""

from collections.abc import Mapping
from typing import Any, ClassVar

import casadi as ca

from pneumo_casadi.effects.common.internal_leakage import drawn
from pneumo_casadi.model.effect import Scope, State
from pneumo_casadi.model.junctions import Expression, Pair, Supply
from pneumo_casadi.parameters import Parameter

PER_VOLUME = Parameter(
    "per_volume",
    0.0,
    "1/m³",
    lower=0.0,
    upper=1e6,
    scale=1e3,
    null=0.0,
    start=1e3,
    description="inverse of the reservoir's volume; none where the regulator fills it in 0.5 ms",
    source="0.1-10 litre: 1e4 to 1e2 1/m³; a feed line without a reservoir: 1e5 (10 ml) and more",
)

#: Time in which the regulator takes a droop back, at least [s]: what is faster is as good as no
#: reservoir, and stiff.
FASTEST = 5e-4


class Reservoir:
    """Reservoir of volume V whose pressure is the droop d below the supply.

    V/(r T) ḋ = q_out − q_in, by mass at one temperature. A litre of air at 7 bar exchanges its heat
    within one or two seconds. Without heat exchange the same pressures would mean a volume γ times
    as large; the recorded channels cannot distinguish the two. At 1/V = 0, the null value, the
    reservoir is infinite and does not droop; the derivatives there are exact. A record begins at
    the supply pressure: what leaks then lowers it for good, within tenths of a second. A volume so
    small that the regulator would take a droop back in less than `FASTEST` counts as one in which
    it takes as long.
    """

    measured_by: ClassVar[str] = "p_supply"
    shows: ClassVar[str] = (
        "both mass flow balances while a chamber fills, longest after large steps"
    )
    confused_with: ClassVar[tuple[str, ...]] = (
        "flow coefficients",
        "valve_null_shift",
        "hose",
        "flow_map_shape",
    )
    separated_by: ClassVar[str] = (
        "fill both chambers at once, then one; a sensor at the supply port"
    )

    states: ClassVar[tuple[State, ...]] = (State("d", "Pa", 2e4),)

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Balance of the reservoir at one temperature."""
        p_s = at.axis["p_supply"] - at["d"]
        lost = drawn(entering["valve_flow"], p_s, at) - self.refill(p_s, at)
        r_T = at.axis["r"] * at.axis["T"]
        per_volume = ca.fmin(at["per_volume"], 1 / (FASTEST * r_T * self.steepest(at)))
        return {"d": r_T * per_volume * lost}

    def refill(self, p_s: Expression, at: Scope) -> Expression:
        """Return what the regulator lets in at the pressure of the reservoir [kg/s]."""
        raise NotImplementedError

    def steepest(self, at: Scope) -> Expression:
        """Return what the regulator lets in per droop, at the most [kg/(s Pa)]."""
        raise NotImplementedError

    def supply(self, ports: Supply, at: Scope) -> Supply:
        """Lower the supply."""
        return Supply(ports.p_supply - at["d"], ports.p_ext)

    def valve_flow(self, q_m: Pair, at: Scope) -> Pair:
        """Leave the flow alone: it is what the reservoir loses."""
        return q_m
