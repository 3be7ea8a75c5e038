"""Hose as a volume at the valve, behind a turbulent conductance to the chamber."""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from pneumo_casadi.effects.common.hose_volume_line import (
    CREDIBLE,
    PARAMETERS,
    SOURCE,
    hose_capacity,
    hose_flow,
    hose_share,
)
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair


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
    source = SOURCE
    shows = "both mass flow balances: late and less flow, without ringing"
    confused_with = ("hose", "valve_dynamics", "pressure_sensor_lag", "flow coefficients", "X_s1")
    separated_by = (
        "steps at both ends of the stroke; sensors at the valve beside those at the chamber"
    )
    credible = CREDIBLE
    parameters = PARAMETERS
    states = tuple(State(f"p_{c}", "Pa", 1e5) for c in "PN")

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the hose at the pressure of the chamber."""
        return {"p_P": at.p.P, "p_N": at.p.N}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Balance of the air in each hose."""
        q, capacity = entering["line"], hose_capacity(at)
        return {
            "p_P": (q.P - _through(at, "P", at.p.P)) / capacity,
            "p_N": (q.N - _through(at, "N", at.p.N)) / capacity,
        }

    def outlet(self, p: Pair, at: Scope) -> Pair:
        """Let the valves work against the pressure in the hose."""
        w = hose_share(at)
        return Pair(p.P + w * (at["p_P"] - p.P), p.N + w * (at["p_N"] - p.N))

    def line(self, q_m: Pair, at: Scope) -> Pair:
        """Return the flow through the restriction."""
        w = hose_share(at)
        return Pair(
            q_m.P + w * (_through(at, "P", at.p.P) - q_m.P),
            q_m.N + w * (_through(at, "N", at.p.N) - q_m.N),
        )


def _through(at: Scope, c: str, p: Expression) -> Expression:
    return hose_flow(at, ca.fmax(at[f"p_{c}"], 1e3), p)
