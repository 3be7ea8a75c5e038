"""Hose with its pressure sensor at the valve: the chamber lies behind it, unmeasured."""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter
from pneumo_casadi.valve.orifice import orifice_expression

#: As of `HoseVolume`: hose and fittings after ISO 6358, and the volume below which it fades out.
B_HOSE, M_HOSE, RATIO_LAMINAR, V_REGULAR = 0.3, 0.5, 0.995, 3e-6


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
    source = "mass balance of a volume at one temperature; ISO 6358-1:2013 for hose and fittings"
    shows = "all balances: the force follows the pressures shown late"
    confused_with = ("hose", "pressure_sensor_lag", "f_v", "X_s1", "X_s4")
    separated_by = "sensors at the valve beside those at the chamber"
    through_states = True
    parameters = (
        Parameter(
            "V",
            0.0,
            "m³",
            lower=0.0,
            upper=1e-3,
            scale=2e-5,
            null=0.0,
            start=5e-5,
            description="volume between valve and restriction",
            source="28 ml a metre of 6 mm bore, 50 ml of 8 mm",
        ),
        Parameter(
            "C",
            6e-9,
            "m³/(s Pa)",
            lower=5e-10,
            upper=1e-7,
            scale=2e-9,
            null=6e-9,
            start=6e-9,
            description="sonic conductance of hose and fittings",
            source="ISO 6358-3 for hoses of 4 to 8 mm, 1 to 5 m: 2e-9 to 3e-8 m³/(s Pa)",
        ),
    )
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
        w = _share(at)
        V = at["V"] + V_REGULAR * (1 - w)
        flows = []
        for (c, p, q), nominal in zip(_chambers(at), q_m, strict=True):
            capacity, displaced = _nominal(at, c)
            rate = at.axis["r"] * at.axis["T"] / V * (nominal - q)
            flows.append(nominal + w * (displaced * p * at.v + capacity * rate - nominal))
        return Pair(*flows)

    def force(self, F: Expression, at: Scope) -> Expression:
        """Replace the pressures shown by those in the chambers."""
        w = _share(at)
        more = at.axis["S_P"] * (at["p_P"] - at.p.P) - at.axis["S_N"] * (at["p_N"] - at.p.N)
        return F + w * more


def _share(at: Scope) -> Expression:
    return 1 - ca.exp(-at["V"] / V_REGULAR)


def _nominal(at: Scope, c: str) -> tuple[Expression, Expression]:
    """Return the capacity of a chamber [kg/Pa], and X_s3 or −X_s6."""
    X = at.axis
    if c == "P":
        return X["X_s1"] + X["X_s2"] * at.x, X["X_s3"]
    return X["X_s4"] - X["X_s5"] * at.x, -X["X_s6"]


def _chambers(at: Scope) -> list[tuple[str, Expression, Expression]]:
    """Return name, pressure shown and flow through the hose of each chamber."""
    T = at.axis["T"]
    return [
        (
            c,
            p,
            orifice_expression(
                at["C"], B_HOSE, M_HOSE, p, ca.fmax(at[f"p_{c}"], 1e3), T, RATIO_LAMINAR
            ),
        )
        for c, p in zip("PN", at.p, strict=True)
    ]
