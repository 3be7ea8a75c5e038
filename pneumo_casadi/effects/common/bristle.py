"""Bristle between piston and tube, a spring that slips: what the forms of presliding share."""

from collections.abc import Mapping
from typing import Any, ClassVar

import casadi as ca

from pneumo_casadi.model.effect import Scope, State
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


class Bristle:
    """Bristle of stiffness σ₀, the state as a share of the Coulomb friction.

    Under the mean level F_c = (F_c⁺ + F_c⁻)/2, with h = σ₀ z/F_c between -1 and 1, presliding
    distance s₀ = F_c/σ₀ and the velocity w at which it slips::

        ḣ = (v - w) / L,   L² = (s₀ + s_r)² + (v τ_r)²
        F = F_c sign(v) + (s₀ / L) F_c (h - sign(v))

    For s_r = τ_r = 0 the friction is F_c h. With them, pole and zero cancel at s₀ = 0 (Coulomb
    friction, regularly), and no rate exceeds 3/τ_r. The energy s₀ F_c h²/2 is stored, the rest is
    dissipated, for any s_r and τ_r.
    """

    shows: ClassVar[str] = (
        "force balance, within a fraction of a millimetre after a reversal and in stops"
    )
    confused_with: ClassVar[tuple[str, ...]] = ("v_s", "stribeck", "backlash", "elastic_load")
    separated_by: ClassVar[str] = (
        "micro-reversals: force steps below breakaway, which move the piston elastically"
    )
    passive: ClassVar[bool] = True
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "distance",
            0.0,
            "m",
            lower=0.0,
            upper=1e-2,
            scale=1e-4,
            null=0.0,
            start=2e-4,
            description="presliding distance s₀ = F_c/σ₀, over which friction builds up",
            source="σ₀ of 1e4-1e6 N/m under 10-30 N, engineering judgement",
        ),
    )
    states: ClassVar[tuple[State, ...]] = (State("share", "1", 1.0),)
    #: Presliding distance of the bristle of each state over s₀; all carry the same friction.
    spread: ClassVar[tuple[float, ...]] = (1.0,)

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the friction of steady sliding."""
        return {state.name: at.direction for state in self.states}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Let each bristle bend with the way and slip at its level."""
        speed = ca.sqrt(at.v**2 + S_SPEED**2)
        return {
            name: (at.v - self.slipping(at.v, speed, at[name])) / _length(at, spread)
            for name, spread in self._bristles()
        }

    def slipping(self, v: Expression, speed: Expression, h: Expression) -> Expression:
        """Return the velocity w at which a bent bristle slips [m/s]; `speed` is rounded |v|.

        Elastic-plastic, after Bouc and Wen, unless a form has another law.
        """
        return (speed * h**3 + v * (h**2 + TINY) ** 1.5) / 2

    def force(self, F: Expression, at: Scope) -> Expression:
        """Replace Coulomb friction by that of the bristles."""
        level = (at.axis["F_c_plus"] + at.axis["F_c_minus"]) / 2
        shares = (
            spread * at["distance"] / _length(at, spread) * level * (at[name] - at.direction)
            for name, spread in self._bristles()
        )
        return F - sum(shares) / len(self.spread)

    def _bristles(self) -> list[tuple[str, float]]:
        """Return the name of each state with what its distance is over s₀."""
        names = (state.name for state in self.states)
        return list(zip(names, self.spread, strict=True))


def _length(at: Scope, spread: float) -> Expression:
    return ca.sqrt((spread * at["distance"] + S_REGULAR) ** 2 + (TAU_LEAST * at.v) ** 2)
