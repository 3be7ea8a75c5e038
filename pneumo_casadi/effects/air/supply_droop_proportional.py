"""Supply droop behind a regulator that opens in proportion to it."""

import casadi as ca

from pneumo_casadi.effects.common.internal_leakage import INTERNAL_LEAKAGE
from pneumo_casadi.effects.common.reservoir import PER_VOLUME, Reservoir
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter


class SupplyDroopProportional(Reservoir, Effect):
    """Reservoir behind a regulator of slope G (see `Reservoir`).

    V/(r T) ḋ = q_out − G max(d, 0), valves at p_supply − d, where q_out is what both valves draw,
    with their internal leakage q_l.

    Over most of its range the outlet pressure of a regulator falls about in a straight line with
    the flow. `SupplyDroop` is the other limit: a regulator that is wide open after a small droop,
    so that its feed is a sonic conductance.
    """

    name = "supply_droop_proportional"
    cause = "supply_droop"
    equation = "p_s = p_supply − d, ḋ = r T/V (q_l + Σ max(q_m, 0) − G max(d, 0))"
    source = "mass balance of the reservoir; forward flow of pressure regulators, ISO 6953-2:2015"
    parameters = (
        PER_VOLUME,
        Parameter(
            "G",
            3e-8,
            "kg/(s Pa)",
            lower=1e-10,
            upper=1e-6,
            scale=1e-8,
            null=3e-8,
            start=3e-8,
            description="slope of the regulator, flow over droop",
            source="100-1000 l/min (ANR) at a droop of 0.3-1 bar, data sheets; small ones a tenth",
        ),
        INTERNAL_LEAKAGE,
    )

    def refill(self, p_s: Expression, at: Scope) -> Expression:
        """Return what the regulator lets in, in proportion to the droop."""
        return at["G"] * ca.fmax(at["d"], 0.0)

    def steepest(self, at: Scope) -> Expression:
        """Return the slope of the regulator."""
        return at["G"]
