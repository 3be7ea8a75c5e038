"""Presliding after Dahl: friction builds up over a way by an exponential."""

from collections.abc import Mapping
from typing import Any

from pneumo_casadi.effects.common.bristle import (
    DISTANCE,
    SEPARATED_BY,
    SHARE,
    SHOWS,
    bristle_rate,
    rounded_speed,
    with_bristle,
)
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression


class PreslidingDahl(Effect):
    """Bristle that slips at any force, the more the farther it is bent, as in LuGre.

    With a way s from a reversal at full friction, F = F_c (1 − 2 exp(−s/s₀)): softer than the
    elastic-plastic bristle, and never purely elastic (see `effects/common/bristle.py`)::

        ḣ = (v - |v| h) / L
    """

    name = "presliding_dahl"
    cause = "presliding"
    equation = "ḣ = (v − |v| h)/s₀, F_c h in place of F_c sign(v), with s₀ = F_c/σ₀"
    source = (
        "Dahl (1976), AIAA Journal 14(12), 1675-1682; as the bristle of LuGre: Canudas de Wit, "
        "Olsson, Åström, Lischinsky (1995), IEEE Transactions on Automatic Control 40(3), 419-425"
    )
    shows = SHOWS
    confused_with = ("v_s", "stribeck", "backlash", "elastic_load")
    separated_by = SEPARATED_BY
    passive = True
    parameters = (DISTANCE,)
    states = (SHARE,)

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the friction of steady sliding."""
        return {"share": at.direction}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Let the bristle bend with the way and slip at the Coulomb level."""
        slipping = rounded_speed(at.v) * at["share"]
        return {"share": bristle_rate(slipping, at)}

    def force(self, F: Expression, at: Scope) -> Expression:
        """Replace Coulomb friction by the bristle's."""
        return with_bristle(F, at)
