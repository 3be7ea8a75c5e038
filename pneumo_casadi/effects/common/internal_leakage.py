"""Internal leakage of the valves, from supply to exhaust."""

import casadi as ca

from pneumo_casadi.model.effect import Scope
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter
from pneumo_casadi.valve.orifice import orifice_expression

#: Critical pressure ratio and subsonic index of narrow gaps, and the pressure ratio above which
#: their flow is proportional to the difference.
B_GAP, M_GAP, RATIO_GAP = 0.3, 0.5, 0.95
#: Reservoir and silencer see it; the flow map does not, because it is of the outlets. It is an
#: average: a spool leaks most at its null position.
INTERNAL_LEAKAGE = Parameter(
    "C_leak",
    0.0,
    "m³/(s Pa)",
    lower=0.0,
    upper=3e-9,
    scale=1e-10,
    null=0.0,
    start=1e-10,
    description="internal leakage q_l: sonic conductance from supply to exhaust of both valves",
    source="0.1-5 % of the rated conductance, data sheets of spool valves with little overlap",
)


def drawn(q_m: Pair, p_supply: Expression, at: Scope) -> Expression:
    """Return the flow that both valves take from a supply at this pressure [kg/s]."""
    leaked = _leaked(p_supply, at.axis["p_ext"], at)
    return leaked + ca.fmax(q_m.P, 0.0) + ca.fmax(q_m.N, 0.0)


def let_out(q_m: Pair, p_exhaust: Expression, at: Scope) -> Expression:
    """Return the flow that both valves let out against this pressure [kg/s]."""
    leaked = _leaked(at.axis["p_supply"], p_exhaust, at)
    return leaked - ca.fmin(q_m.P, 0.0) - ca.fmin(q_m.N, 0.0)


def _leaked(p_supply: Expression, p_exhaust: Expression, at: Scope) -> Expression:
    T = at.axis["T"]
    return orifice_expression(at["C_leak"], B_GAP, M_GAP, p_supply, p_exhaust, T, RATIO_GAP)
