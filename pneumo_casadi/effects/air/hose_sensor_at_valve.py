"""Hose with its pressure sensor at the valve: the chamber lies behind it, unmeasured."""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from pneumo_casadi.effects.common.hose_volume_line import (
    PARAMETERS,
    SOURCE,
    hose_capacity,
    hose_flow,
    hose_share,
)
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair


class HoseSensorAtValve(Effect):
    r"""Volume V at each valve, where the pressure is measured, and a restriction to the chamber.

    The states are the pressures p_c in the chambers, which move the piston:

    .. math:: \frac{V}{r T} \dot p = q_{valve}(u, p) - q_h, \qquad
              (X_{s1} + X_{s2} x) \dot p_c = q_h - X_{s3} p_c ẋ, \qquad
              q_h = C ρ_0 \sqrt{T_0/T} \max(p, p_c) ω(p, p_c)

    The share w = 1 − exp(−V/V_0) blends: at V = 0 the axis is the nominal one, exactly.
    """

    name = "hose_sensor_at_valve"
    cause = "hose"
    equation = "V/(r T) ṗ = q_valve(u, p) − q_h, (X_s1 + X_s2 x) ṗ_c = q_h − X_s3 p_c ẋ"
    source = SOURCE
    shows = "all balances: the force follows the pressures shown late"
    confused_with = ("hose", "pressure_sensor_lag", "f_v", "X_s1", "X_s4")
    separated_by = "sensors at the valve beside those at the chamber"
    through_states = True
    parameters = PARAMETERS
    states = tuple(State(f"p_{c}", "Pa", 1e5) for c in "PN")

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the chamber at the pressure of the hose."""
        return {"p_P": at.p.P, "p_N": at.p.N}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Balance of the air in each chamber."""
        rates = {}
        for c, _, q in _chambers(at):
            capacity, displaced = _nominal(at, c)
            rates[f"p_{c}"] = (q - displaced * at[f"p_{c}"] * at.v) / capacity
        return rates

    def chamber_energy(self, q_m: Pair, at: Scope) -> Pair:
        """Return the flow that would raise the pressure of a chamber as that of the hose."""
        w = hose_share(at)
        flows = []
        for (c, p, q), nominal in zip(_chambers(at), q_m, strict=True):
            capacity, displaced = _nominal(at, c)
            rate = (nominal - q) / hose_capacity(at)
            flows.append(nominal + w * (displaced * p * at.v + capacity * rate - nominal))
        return Pair(*flows)

    def force(self, F: Expression, at: Scope) -> Expression:
        """Replace the pressures shown by those in the chambers."""
        w = hose_share(at)
        more = at.axis["S_P"] * (at["p_P"] - at.p.P) - at.axis["S_N"] * (at["p_N"] - at.p.N)
        return F + w * more


def _nominal(at: Scope, c: str) -> tuple[Expression, Expression]:
    """Return the capacity of a chamber [kg/Pa], and X_s3 or −X_s6."""
    X = at.axis
    if c == "P":
        return X["X_s1"] + X["X_s2"] * at.x, X["X_s3"]
    return X["X_s4"] - X["X_s5"] * at.x, -X["X_s6"]


def _chambers(at: Scope) -> list[tuple[str, Expression, Expression]]:
    """Return name, pressure shown and flow through the hose of each chamber."""
    return [
        (c, p, hose_flow(at, p, ca.fmax(at[f"p_{c}"], 1e3)))
        for c, p in zip("PN", at.p, strict=True)
    ]
