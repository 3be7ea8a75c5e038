"""Hose with its pressure sensor at the valve: the chamber lies behind it, unmeasured."""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from pneumo_casadi.effects.common.hose_volume_line import (
    PARAMETERS,
    SOURCE,
    credible_volume,
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

    The share w = 1 − exp(−V/V_0) blends: at V = 0 the axis is the nominal one, exactly. V_0 is
    3 ml, or C times 1e3 s Pa if that is less.
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

    @classmethod
    def credible_at(cls, values: Mapping[str, float]) -> Mapping[str, tuple[float, float]]:
        """Return the range of the volume."""
        return credible_volume(values)

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the chamber at the pressure of the hose."""
        shown = entering["chamber_pressure"]
        return {"p_P": shown.P, "p_N": shown.N}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Balance of the air in each chamber, leaks and heat included."""
        rates = {}
        arrived = (entering[name] for name in ("chamber_energy", "line", "capacity"))
        for (c, q), at_chamber, sent, capacity in zip(_passed(at), *arrived, strict=True):
            q_c = q + at_chamber - sent
            rates[f"p_{c}"] = (q_c - _displaced(at, c) * at[f"p_{c}"] * at.v) / capacity
        return rates

    def line(self, q_m: Pair, at: Scope) -> Pair:
        """Return the flow as it is: where the sensor sits, no other enters or leaves."""
        return q_m

    def chamber_pressure(self, p: Pair, at: Scope) -> Pair:
        """Return the pressures in the chambers in the place of those shown."""
        w = hose_share(at["V"], at)
        return Pair(*(shown + w * (at[f"p_{c}"] - shown) for c, shown in zip("PN", p, strict=True)))

    def chamber_energy(self, q_m: Pair, at: Scope) -> Pair:
        """Return what the valve sends and the hose does not pass on; it displaces nothing."""
        w = hose_share(at["V"], at)
        flows = []
        for (c, q), nominal, sent in zip(_passed(at), q_m, at.entering["line"], strict=True):
            displaced = _displaced(at, c) * getattr(at.p, c) * at.v
            flows.append(nominal + w * (sent - q - nominal) + displaced * w)
        return Pair(*flows)

    def capacity(self, C: Pair, at: Scope) -> Pair:
        """Return the capacity of the hose, where the sensor sits."""
        w = hose_share(at["V"], at)
        return Pair(*(nominal + w * (hose_capacity(at["V"], at) - nominal) for nominal in C))


def _displaced(at: Scope, c: str) -> Expression:
    """Return X_s3 or −X_s6, the air of a chamber that the piston displaces [kg/(Pa m)]."""
    return at.axis["X_s3"] if c == "P" else -at.axis["X_s6"]


def _passed(at: Scope) -> list[tuple[str, Expression]]:
    """Return name of, and flow through the hose into, each chamber."""
    shown = at.entering["chamber_pressure"]
    return [
        (c, hose_flow(at, p, ca.fmax(at[f"p_{c}"], 1e3))) for c, p in zip("PN", shown, strict=True)
    ]
