"""Exhaust restriction: a silencer on the common exhaust raises the back pressure."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import casadi as ca

from pneumo_casadi.effects.common.internal_leakage import INTERNAL_LEAKAGE, let_out
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair, Supply
from pneumo_casadi.parameters import Parameter


class ExhaustRestriction(Effect):
    """Turbulent back pressure of what both valves let out through one silencer.

    p_e² = p_ext² + 2 r T R q² (Δp = R q²/ρ at the mean density) with q what the valves let out,
    q_l of it by internal leakage, reached in the time `tau` in which the space before the silencer
    fills. A record begins without back pressure. The same law is the sonic one, q = C ρ₀ p_e,
    where the back pressure is high: R = 1 / (2 r T (C ρ₀)²). A valve that is choked does not feel
    it. The state is the back pressure p_e − p_ext and not the flow, whose square would leave its
    initial value without influence.
    """

    name = "exhaust_restriction"
    equation = "p_e = p_ext + b, τ ḃ = √(p_ext² + 2 r T R (q_l + Σ max(−q_m, 0))²) − p_ext − b"
    source = "compressible Darcy flow; sonic conductance of silencers, ISO 6358-1:2013"
    shows = "mass flow balance of a chamber that empties at low pressure; none while choked"
    confused_with = ("flow coefficients", "flow_map_shape", "hose")
    separated_by = "empty a chamber from high pressure to the end: only the end changes"
    # A small resistance is not felt, and leads no fit to a large one.
    scanned = MappingProxyType(
        {"R": (1e10, 3e10, 1e11, 3e11, 1e12, 3e12, 1e13, 1e14), "tau": (0.01, 0.1)}
    )
    parameters = (
        Parameter(
            "R",
            0.0,
            "1/m⁴",
            lower=0.0,
            upper=1e15,
            scale=1e10,
            null=0.0,
            start=3e10,
            description="turbulent resistance of the silencer, Δp = R q²/ρ",
            source="0.1-1 bar at 5 g/s: 5e8 to 7e9 1/m⁴; clogged ones to 1e12, of 16 mm bore 1e14",
        ),
        Parameter(
            "tau",
            2e-3,
            "s",
            lower=1e-3,
            upper=1.0,
            scale=1e-2,
            null=2e-3,
            start=1e-2,
            description="time in which the space before the silencer fills",
            source="V / (r T C ρ₀): 10 cm³ behind a sonic conductance of 2e-9 m³/(s Pa): 50 ms",
        ),
        INTERNAL_LEAKAGE,
    )
    states = (State("b", "Pa", 1e4),)

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Fill the space before the silencer."""
        p_ext = at.axis["p_ext"]
        out = let_out(entering["valve_flow"], p_ext + at["b"], at)
        raised = 2 * at.axis["r"] * at.axis["T"] * at["R"] * out**2
        return {"b": (ca.sqrt(p_ext**2 + raised) - p_ext - at["b"]) / at["tau"]}

    def supply(self, ports: Supply, at: Scope) -> Supply:
        """Raise the pressure at the exhaust ports."""
        return Supply(ports.p_supply, ports.p_ext + at["b"])

    def valve_flow(self, q_m: Pair, at: Scope) -> Pair:
        """Leave the flow alone: what goes out is what the silencer gets."""
        return q_m
