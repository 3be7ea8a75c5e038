"""Presliding: at a reversal the contact is a spring; Coulomb friction builds up over a way."""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from pneumo_casadi.effect import Effect, Expression, Scope, State
from pneumo_casadi.parameters import Parameter

#: Way over which friction builds up in the numerator [m]: at distance = 0 pole and zero cancel.
S_REGULAR = 5e-6
#: The bristle never answers faster than this [s]. Its rate grows with the speed, which would make
#: the equations stiff where presliding is over long since.
TAU_LEAST = 1e-3


class Presliding(Effect):
    """LuGre's bristle with a constant level, the state as a share of the Coulomb friction.

    Bristle of stiffness σ₀ under the mean level F_c = (F_c⁺ + F_c⁻)/2, h = σ₀ z/F_c between -1
    and 1, presliding distance s₀ = F_c/σ₀::

        ḣ = (v - |v| h) / L,   L² = (s₀ + s_r)² + (v τ_r)²
        F = F_c sign(v) + (s₀ / L) F_c (h - sign(v))

    For s_r = τ_r = 0 the friction is F_c h. With them, pole and zero cancel at s₀ = 0 (Coulomb
    friction, regularly), and no rate exceeds 1/τ_r. The energy s₀ F_c h²/2 is stored, the rest
    is dissipated, for any s_r and τ_r.
    """

    name = "presliding"
    equation = "ḣ = (v − |v| h)/s₀, F_c h in place of F_c sign(v), with s₀ = F_c/σ₀"
    source = (
        "Canudas de Wit, Olsson, Åström, Lischinsky (1995), IEEE Transactions on Automatic "
        "Control 40(3), 419-425"
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
        return {"share": (at.v - _speed(at) * at["share"]) / self._length(at)}

    def force(self, F: Expression, at: Scope) -> Expression:
        """Replace Coulomb friction by the bristle's."""
        level = (at.axis["F_c_plus"] + at.axis["F_c_minus"]) / 2
        return F - at["distance"] / self._length(at) * level * (at["share"] - at.direction)

    @staticmethod
    def _length(at: Scope) -> Expression:
        return ca.sqrt((at["distance"] + S_REGULAR) ** 2 + (TAU_LEAST * at.v) ** 2)


def _speed(at: Scope) -> Expression:
    """Return |v|, smoothed as v / tanh(v / v_s): the steady share is the nominal direction."""
    v_s = at.axis["v_s"]
    z = ca.sqrt((at.v / v_s) ** 2 + 1e-12)
    return v_s * z / ca.tanh(z)
