"""Hose as a volume at the valve, behind a turbulent conductance to the chamber."""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter
from pneumo_casadi.valve.orifice import orifice_expression

#: Critical pressure ratio and subsonic index of hose and fittings.
B_HOSE, M_HOSE = 0.3, 0.5
#: Pressure ratio above which the flow is laminar; Reynolds numbers of some thousand.
RATIO_LAMINAR = 0.995
#: Volume below which the hose fades out of the axis [m³]: 10 cm of 6 mm bore.
V_REGULAR = 3e-6


class HoseVolume(Effect):
    r"""Volume V at each valve, and a restriction of sonic conductance C to the chamber.

    The valve works against the pressure p_h in the hose; the sensor is in the chamber.

    .. math:: \frac{V}{r T} \dot p_h = q_{valve}(u, p_h) - q_h, \qquad
              q_h = C ρ_0 \sqrt{T_0/T} \max(p_h, p) ω(p_h, p)

    The chamber gets the share w = 1 − exp(−V/V_0) of q_h and the rest of the valve's flow, and
    the valve works against p + w (p_h − p): at V = 0 the axis is the nominal one, exactly, and
    from 10 ml on w is 1 within 4 %. The air in the hose is at the temperature of its wall.
    """

    name = "hose_volume"
    cause = "hose"
    equation = "V/(r T) ṗ_h = q_valve(u, p_h) − q_h, q_h = C ρ₀ √(T₀/T) max(p_h, p) ω(p_h, p)"
    source = "mass balance of a volume at one temperature; ISO 6358-1:2013 for hose and fittings"
    shows = "both mass flow balances: late and less flow, without ringing"
    confused_with = ("hose", "valve_dynamics", "pressure_sensor_lag", "flow coefficients", "X_s1")
    separated_by = (
        "steps at both ends of the stroke; sensors at the valve beside those at the chamber"
    )
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
        """Start with the hose at the pressure of the chamber."""
        return {"p_P": at.p.P, "p_N": at.p.N}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Balance of the air in each hose."""
        V = at["V"] + V_REGULAR * (1 - _share(at))
        rT = at.axis["r"] * at.axis["T"]
        q = entering["line"]
        return {
            "p_P": rT / V * (q.P - _through(at, "P", at.p.P)),
            "p_N": rT / V * (q.N - _through(at, "N", at.p.N)),
        }

    def outlet(self, p: Pair, at: Scope) -> Pair:
        """Let the valves work against the pressure in the hose."""
        w = _share(at)
        return Pair(p.P + w * (at["p_P"] - p.P), p.N + w * (at["p_N"] - p.N))

    def line(self, q_m: Pair, at: Scope) -> Pair:
        """Return the flow through the restriction."""
        w = _share(at)
        return Pair(
            q_m.P + w * (_through(at, "P", at.p.P) - q_m.P),
            q_m.N + w * (_through(at, "N", at.p.N) - q_m.N),
        )


def _share(at: Scope) -> Expression:
    return 1 - ca.exp(-at["V"] / V_REGULAR)


def _through(at: Scope, c: str, p: Expression) -> Expression:
    p_h = ca.fmax(at[f"p_{c}"], 1e3)
    return orifice_expression(at["C"], B_HOSE, M_HOSE, p_h, p, at.axis["T"], RATIO_LAMINAR)
