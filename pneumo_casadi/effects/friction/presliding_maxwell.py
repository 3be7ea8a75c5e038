"""Presliding after Maxwell and Iwan: contacts in parallel, of which one slips after another."""

from pneumo_casadi.effects.common.bristle import Bristle
from pneumo_casadi.model.effect import Effect, State


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
    #: Evenly between none and twice the mean.
    spread = (1 / 3, 1.0, 5 / 3)
    states = tuple(State(f"share_{i}", "1", 1.0) for i in range(3))
