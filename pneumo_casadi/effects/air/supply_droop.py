"""Supply droop: the valves draw from a reservoir that a regulator refills too slowly."""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from pneumo_casadi.model.absorption import Absorption
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair, Supply
from pneumo_casadi.parameters import Parameter
from pneumo_casadi.valve.orifice import orifice_expression

#: Critical pressure ratio and subsonic index of regulator and feed line.
B_FEED, M_FEED = 0.3, 0.5
#: Pressure ratio above which the flow of the regulator is proportional to the droop, because its
#: valve follows the downstream pressure. Of 0.90, 0.95, 0.97 and 0.999, the value 0.95 leaves the
#: smallest residual on a recording simulated by another program.
RATIO_FEED = 0.95


class SupplyDroop(Effect):
    """Reservoir of volume V behind a regulator of sonic conductance C.

    V/(r T) ḋ = q_in − C ρ₀ √(T₀/T) p_supply ω((p_supply − d)/p_supply), valves at
    p_supply − d, where q_in is what both valves draw; ω grows in proportion to small droops. The
    balance is that of mass at one temperature. A litre of air at 7 bar exchanges its heat within
    one or two seconds. Without heat exchange the same pressures would mean a volume γ times as
    large; the recorded channels cannot distinguish the two. At 1/V = 0, the null value, the
    reservoir is infinite and does not droop; the derivatives there are exact.
    """

    name = "supply_droop"
    measured_by = "p_supply"
    absorbed_by = Absorption(("S_P",), also=("S_N",), unless=("S_N/S_P", "map form"))
    equation = "p_s = p_supply − d, ḋ = r T/V (Σ max(q_m, 0) − C ρ₀ √(T₀/T) p_supply ω(p_s))"
    source = "mass balance of the reservoir; ISO 6358-1:2013 for the regulator, linear below 5 %"
    shows = "both mass flow balances while a chamber fills, longest after large steps"
    confused_with = ("flow coefficients", "valve_null_shift", "hose", "flow_map_shape")
    separated_by = "fill both chambers at once, then one; a sensor at the supply port"
    parameters = (
        Parameter(
            "per_volume",
            0.0,
            "1/m³",
            lower=0.0,
            upper=1e4,
            scale=1e3,
            null=0.0,
            start=1e3,
            description="inverse of the reservoir's volume",
            source="0.1-10 litre: 1e4 to 1e2 1/m³",
        ),
        Parameter(
            "C",
            5e-9,
            "m³/(s Pa)",
            lower=1e-10,
            upper=5e-8,
            scale=2e-9,
            null=5e-9,
            start=5e-9,
            description="sonic conductance of regulator and feed line",
            source="1e-9 to 3e-8 m³/(s Pa), small regulators",
        ),
    )
    states = (State("d", "Pa", 2e4),)

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Balance of the reservoir at one temperature."""
        q = entering["valve_flow"]
        p_feed, T = at.axis["p_supply"], at.axis["T"]
        p_s = p_feed - at["d"]
        refill = orifice_expression(at["C"], B_FEED, M_FEED, p_feed, p_s, T, RATIO_FEED)
        drawn = ca.fmax(q.P, 0.0) + ca.fmax(q.N, 0.0)
        return {"d": at.axis["r"] * T * at["per_volume"] * (drawn - refill)}

    def supply(self, ports: Supply, at: Scope) -> Supply:
        """Lower the supply."""
        return Supply(ports.p_supply - at["d"], ports.p_ext)

    def valve_flow(self, q_m: Pair, at: Scope) -> Pair:
        """Leave the flow alone: it is what the reservoir loses."""
        return q_m
