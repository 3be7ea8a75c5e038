"""Supply droop: the valves draw from a reservoir that a regulator refills too slowly."""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from pneumo_casadi.effect import Effect, Expression, Pair, Scope, State, Supply
from pneumo_casadi.flow.orifice import orifice_expression
from pneumo_casadi.parameters import Parameter

#: Critical pressure ratio and subsonic index of regulator and feed line.
B_FEED, M_FEED = 0.3, 0.5
#: Ratio of specific heats of air.
GAMMA = 1.4


class SupplyDroop(Effect):
    """Reservoir of volume V behind a regulator of sonic conductance C.

    V/(γ r T) ḋ = q_in − C ρ₀ √(T₀/T) p_supply ω((p_supply − d)/p_supply), valves at
    p_supply − d, where q_in is what both valves draw. The balance is that of energy, with γ: a
    stroke draws for tenths of a second, and a litre of air takes seconds to exchange heat. An
    infinite reservoir does not droop: 1/V = 0 is the nominal axis, with true derivatives.
    """

    name = "supply_droop"
    equation = "p_s = p_supply − d, ḋ = γ r T/V (Σ max(q_m, 0) − C ρ₀ √(T₀/T) p_supply ω(p_s))"
    source = "energy balance of the reservoir; ISO 6358-1:2013 for the regulator"
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
        """Balance of the reservoir, adiabatic."""
        q = entering["valve_flow"]
        p_feed, T = at.axis["p_supply"], at.axis["T"]
        refill = orifice_expression(at["C"], B_FEED, M_FEED, p_feed, p_feed - at["d"], T)
        drawn = ca.fmax(q.P, 0.0) + ca.fmax(q.N, 0.0)
        return {"d": GAMMA * at.axis["r"] * T * at["per_volume"] * (drawn - refill)}

    def supply(self, ports: Supply, at: Scope) -> Supply:
        """Lower the supply."""
        return Supply(ports.p_supply - at["d"], ports.p_ext)

    def valve_flow(self, q_m: Pair, at: Scope) -> Pair:
        """Leave the flow alone: it is what the reservoir loses."""
        return q_m
