"""Bleed: air that valves pass from supply to exhaust, whatever they give to the chambers."""

import casadi as ca

from pneumo_casadi.model.effect import Scope
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter
from pneumo_casadi.valve.orifice import orifice_expression

#: Critical pressure ratio and subsonic index of narrow gaps.
B_GAP, M_GAP = 0.3, 0.5
#: Reservoir and silencer see it; the flow map does not, because it is of the outlets.
BLEED = Parameter(
    "C_bleed",
    0.0,
    "m³/(s Pa)",
    lower=0.0,
    upper=3e-9,
    scale=1e-10,
    null=0.0,
    start=0.0,
    description="sonic conductance from supply to exhaust within both valves, at any command",
    source="0.1-5 % of the rated conductance, data sheets of spool valves with little overlap",
)


def drawn(q_m: Pair, p_supply: Expression, at: Scope) -> Expression:
    """Return the flow that both valves take from the supply [kg/s]."""
    return _bleed(p_supply, at) + ca.fmax(q_m.P, 0.0) + ca.fmax(q_m.N, 0.0)


def let_out(q_m: Pair, p_supply: Expression, at: Scope) -> Expression:
    """Return the flow that both valves let out [kg/s]."""
    return _bleed(p_supply, at) - ca.fmin(q_m.P, 0.0) - ca.fmin(q_m.N, 0.0)


def _bleed(p_supply: Expression, at: Scope) -> Expression:
    return orifice_expression(at["C_bleed"], B_GAP, M_GAP, p_supply, at.axis["p_ext"], at.axis["T"])
