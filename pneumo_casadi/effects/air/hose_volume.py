"""Hose as a volume at the valve, behind a turbulent conductance to the chamber."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import casadi as ca

from pneumo_casadi.effects.common.hose_volume_line import (
    CONDUCTANCE,
    LAMINAR,
    PARAMETERS,
    SOURCE,
    VOLUME,
    credible_volume,
    hose_capacity,
    hose_flow,
    hose_share,
)
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter


class HoseVolume(Effect):
    r"""Volume V at each valve, and a restriction of sonic conductance C to the chamber.

    The valve works against the pressure p_h in the hose; the sensor is in the chamber.

    .. math:: \frac{V}{r T} \dot p_h = q_{valve}(u, p_h) - q_h, \qquad
              q_h = C ρ_0 \sqrt{T_0/T} \max(p_h, p) ω(p_h, p)

    The chamber gets the share w = 1 − exp(−V/V_0) of q_h and the rest of the valve's flow, and
    the valve works against p + w (p_h − p): at V = 0 the axis is the nominal one, exactly, and
    from 10 ml on w is 1 within 4 %. V_0 is 3 ml, or C times 1e3 s Pa if that is less. The air in
    the hose is at the temperature of its wall.
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
    parameters: ClassVar[tuple[Parameter, ...]] = PARAMETERS
    states = tuple(State(f"p_{c}", "Pa", 1e5) for c in "PN")

    @classmethod
    def credible_at(cls, values: Mapping[str, float]) -> Mapping[str, tuple[float, float]]:
        """Return the range of the volume."""
        return credible_volume(values)

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the hose at the pressure of the chamber."""
        return {"p_P": at.p.P, "p_N": at.p.N}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Balance of the air in each hose."""
        return {
            f"p_{c}": (q - _through(at, c)) / hose_capacity(V, at)
            for c, q, V in zip("PN", entering["line"], self.volumes(at), strict=True)
        }

    def outlet(self, p: Pair, at: Scope) -> Pair:
        """Let the valves work against the pressure in the hose."""
        hoses = zip("PN", p, self.volumes(at), strict=True)
        return Pair(*(shown + hose_share(V, at) * (at[f"p_{c}"] - shown) for c, shown, V in hoses))

    def line(self, q_m: Pair, at: Scope) -> Pair:
        """Return the flow through the restriction."""
        hoses = zip("PN", q_m, self.volumes(at), strict=True)
        return Pair(*(q + hose_share(V, at) * (_through(at, c) - q) for c, q, V in hoses))

    def volumes(self, at: Scope) -> Pair:
        """Return the volume of each hose [m³]."""
        return Pair(at["V"], at["V"])


class HoseVolumePerChamber(HoseVolume):
    """Volume at each valve, V_P and V_N: the valves sit nearer to one end of the cylinder.

    The restrictions, of fittings and bore, are alike. One of the two hoses may be missing.
    """

    name = "hose_volume_per_chamber"
    cause = "hose"
    equation = "V_c/(r T) ṗ_h = q_valve(u, p_h) − q_h of each chamber c, q_h as of hose_volume"
    generalises = "hose_volume"
    parameters = (
        *(
            replace(VOLUME, name=f"V_{c}", description=f"volume of the hose to chamber {c}")
            for c in "PN"
        ),
        CONDUCTANCE,
        LAMINAR,
    )

    @classmethod
    def credible_at(cls, values: Mapping[str, float]) -> Mapping[str, tuple[float, float]]:
        """Return no range: a hose may be missing."""
        return {}

    def volumes(self, at: Scope) -> Pair:
        """Return the volume of each hose [m³]."""
        return Pair(at["V_P"], at["V_N"])


def _through(at: Scope, c: str) -> Expression:
    return hose_flow(at, ca.fmax(at[f"p_{c}"], 1e3), getattr(at.p, c))
