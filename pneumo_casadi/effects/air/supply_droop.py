"""Supply droop: the valves draw from a reservoir that a regulator refills too slowly."""

from pneumo_casadi.effects.common.internal_leakage import INTERNAL_LEAKAGE
from pneumo_casadi.effects.common.reservoir import PER_VOLUME, Reservoir
from pneumo_casadi.model.absorption import Absorption
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter
from pneumo_casadi.valve.orifice import orifice_expression

#: Critical pressure ratio and subsonic index of regulator and feed line.
B_FEED, M_FEED = 0.3, 0.5
#: Pressure ratio above which the flow of the regulator is proportional to the droop, because its
#: valve follows the downstream pressure. Of 0.90, 0.95, 0.97 and 0.999, the value 0.95 leaves the
#: smallest residual on a recording simulated by another program.
RATIO_FEED = 0.95


class SupplyDroop(Reservoir, Effect):
    """Reservoir of volume V behind a regulator of sonic conductance C (see `Reservoir`).

    V/(r T) ḋ = q_out − C ρ₀ √(T₀/T) p_supply ω((p_supply − d)/p_supply), valves at
    p_supply − d, where q_out is what both valves draw, with their internal leakage q_l; ω grows
    in proportion to small droops.
    """

    name = "supply_droop"
    absorbed_by = Absorption(("S_P",), also=("S_N",), unless=("S_N/S_P", "map form"))
    equation = "p_s = p_supply − d, ḋ = r T/V (q_l + Σ max(q_m, 0) − C ρ₀ √(T₀/T) p_supply ω(p_s))"
    source = "mass balance of the reservoir; ISO 6358-1:2013 for the regulator, linear below 5 %"
    parameters = (
        PER_VOLUME,
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
        INTERNAL_LEAKAGE,
    )

    def refill(self, p_s: Expression, at: Scope) -> Expression:
        """Return what the feed passes, of a regulator that is wide open after a small droop."""
        p_feed, T = at.axis["p_supply"], at.axis["T"]
        return orifice_expression(at["C"], B_FEED, M_FEED, p_feed, p_s, T, RATIO_FEED)

    def steepest(self, at: Scope) -> Expression:
        """Return the slope where the flow is still proportional to the droop."""
        p_feed = at.axis["p_supply"]
        return self.refill(RATIO_FEED * p_feed, at) / ((1 - RATIO_FEED) * p_feed)
