"""Presliding: at a reversal the contact is a spring; Coulomb friction builds up over a way."""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter

#: Way over which friction builds up in the numerator [m]: at distance = 0 pole and zero cancel.
S_REGULAR = 5e-6
#: The bristle hardly answers faster than this [s]. Its rate grows with the speed, which would make
#: the equations stiff where presliding is over long since.
TAU_LEAST = 1.5e-3
#: Rounding of the speed [m/s]: a bent bristle at rest lets go at a rate of S_SPEED/(2 s₀).
S_SPEED = 1e-5
#: Keeps |h|³ differentiable often enough at 0.
TINY = 1e-12


class Presliding(Effect):
    """Elastic-plastic bristle, the state as a share of the Coulomb friction.

    Bristle of stiffness σ₀ under the mean level F_c = (F_c⁺ + F_c⁻)/2, h = σ₀ z/F_c between -1
    and 1, presliding distance s₀ = F_c/σ₀, with Bouc's and Wen's law of hysteresis, exponent 3::

        ḣ = (v - (|v| h³ + v |h|³)/2) / L,   L² = (s₀ + s_r)² + (v τ_r)²
        F = F_c sign(v) + (s₀ / L) F_c (h - sign(v))

    It bends back elastically and slips only where it is bent far and bent further. The bristle of
    LuGre, ḣ = (v - |v| h)/s₀, slips at any force and creeps away under the least vibration.

    For s_r = τ_r = 0 the friction is F_c h. With them, pole and zero cancel at s₀ = 0 (Coulomb
    friction, regularly), and no rate exceeds 3/τ_r. The energy s₀ F_c h²/2 is stored, the rest
    is dissipated, for any s_r and τ_r.
    """

    name = "presliding"
    equation = "ḣ = (v − (|v| h³ + v |h|³)/2)/s₀, F_c h in place of F_c sign(v), with s₀ = F_c/σ₀"
    source = (
        "Wen (1976), Journal of the Engineering Mechanics Division ASCE 102(2), 249-263; drift of "
        "bristles: Dupont, Hayward, Armstrong, Altpeter (2002), IEEE Transactions on Automatic "
        "Control 47(5), 787-792"
    )
    shows = "force balance, within a fraction of a millimetre after a reversal and in stops"
    confused_with = ("v_s", "stribeck", "backlash", "elastic_load")
    separated_by = "micro-reversals: force steps below breakaway, which move the piston elastically"
    passive = True
    parameters = (
        Parameter(
            "distance",
            0.0,
            "m",
            lower=0.0,
            upper=3e-3,
            scale=1e-4,
            null=0.0,
            start=2e-4,
            description="presliding distance s₀ = F_c/σ₀, over which friction builds up",
            source="σ₀ of 1e4-1e6 N/m under 10-30 N, engineering judgement",
        ),
    )
    states = (State("share", "1", 1.0),)

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the friction of steady sliding."""
        return {"share": at.direction}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Let the bristle bend with the way and slip at the Coulomb level."""
        v, h = at.v, at["share"]
        speed = ca.sqrt(v**2 + S_SPEED**2)
        slipping = (speed * h**3 + v * (h**2 + TINY) ** 1.5) / 2
        return {"share": (v - slipping) / self._length(at)}

    def force(self, F: Expression, at: Scope) -> Expression:
        """Replace Coulomb friction by the bristle's."""
        level = (at.axis["F_c_plus"] + at.axis["F_c_minus"]) / 2
        return F - at["distance"] / self._length(at) * level * (at["share"] - at.direction)

    @staticmethod
    def _length(at: Scope) -> Expression:
        return ca.sqrt((at["distance"] + S_REGULAR) ** 2 + (TAU_LEAST * at.v) ** 2)
