"""Presliding after Dahl: friction builds up over a way by an exponential."""

from pneumo_casadi.effects.common.bristle import Bristle
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.model.junctions import Expression


class PreslidingDahl(Bristle, Effect):
    """Bristle that slips at any force, the more the farther it is bent, as in LuGre.

    With a way s from a reversal at full friction, F = F_c (1 − 2 exp(−s/s₀)): softer than the
    elastic-plastic bristle, and never purely elastic (see `Bristle`)::

        ḣ = (v - |v| h) / L
    """

    name = "presliding_dahl"
    cause = "presliding"
    equation = "ḣ = (v − |v| h)/s₀, F_c h in place of F_c sign(v), with s₀ = F_c/σ₀"
    source = (
        "Dahl (1976), AIAA Journal 14(12), 1675-1682; as the bristle of LuGre: Canudas de Wit, "
        "Olsson, Åström, Lischinsky (1995), IEEE Transactions on Automatic Control 40(3), 419-425"
    )

    def slipping(self, v: Expression, speed: Expression, h: Expression) -> Expression:
        """Return the velocity w at which a bent bristle slips [m/s]."""
        return speed * h
