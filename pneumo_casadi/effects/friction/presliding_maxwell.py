"""Presliding after Maxwell and Iwan: contacts in parallel, of which one slips after another."""

from collections.abc import Mapping
from typing import Any

from pneumo_casadi.effects.common.bristle import Bristle, length_of, rounded_speed, slip_abruptly
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression

#: Presliding distances of the elements over their mean, evenly between none and twice the mean;
#: each carries the same friction.
SPREAD = (1 / 3, 1.0, 5 / 3)


class PreslidingMaxwell(Bristle, Effect):
    """Elastic-plastic bristles in parallel, whose presliding distances differ.

    A seal does not let go all at once. Friction builds up in a curve over nearly twice the mean
    distance s₀, and after a reversal in about the same one, twice as large (rule of Masing). One
    bristle of Bouc's and Wen's law is straight there until the force changes sign, one of Dahl's
    begins twice as steep. With three elements of equal friction (see `Bristle`)::

        ḣᵢ = (v − (|v| hᵢ³ + v |hᵢ|³)/2) / Lᵢ,   F_c Σ hᵢ/3 in place of F_c sign(v)
    """

    name = "presliding_maxwell"
    cause = "presliding"
    equation = (
        "ḣᵢ = (v − (|v| hᵢ³ + v |hᵢ|³)/2)/sᵢ, F_c Σ hᵢ/3 in place of F_c sign(v), Σ sᵢ/3 = s₀"
    )
    source = (
        "Iwan (1966), Journal of Applied Mechanics 33(4), 893-900; generalised Maxwell slip: "
        "Al-Bender, Lampaert, Swevers (2005), IEEE Transactions on Automatic Control 50(11), "
        "1883-1887"
    )
    states = tuple(State(f"share_{i}", "1", 1.0) for i in range(len(SPREAD)))

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the friction of steady sliding."""
        return {state.name: at.direction for state in self.states}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Let each bristle bend with the way and slip at its level."""
        speed = rounded_speed(at)
        return {
            state.name: (at.v - slip_abruptly(at.v, speed, at[state.name])) / length_of(at, spread)
            for state, spread in zip(self.states, SPREAD, strict=True)
        }

    def force(self, F: Expression, at: Scope) -> Expression:
        """Replace Coulomb friction by that of the bristles."""
        level = (at.axis["F_c_plus"] + at.axis["F_c_minus"]) / 2
        shares = (
            spread * at["distance"] / length_of(at, spread) * (at[state.name] - at.direction)
            for state, spread in zip(self.states, SPREAD, strict=True)
        )
        return F - level * sum(shares) / len(SPREAD)
