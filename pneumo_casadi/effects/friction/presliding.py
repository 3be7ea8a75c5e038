"""Presliding: at a reversal the contact is a spring; Coulomb friction builds up over a way."""

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

#: Keeps |h|³ differentiable often enough at 0.
TINY = 1e-12


class Presliding(Effect):
    """Elastic-plastic bristle: it bends back elastically, and slips only bent far and bent further.

    Bouc's and Wen's law of hysteresis, exponent 3 (see `effects/common/bristle.py`)::

        ḣ = (v - (|v| h³ + v |h|³)/2) / L

    The bristle of LuGre slips at any force and creeps away under the least vibration.
    """

    name = "presliding"
    equation = "ḣ = (v − (|v| h³ + v |h|³)/2)/s₀, F_c h in place of F_c sign(v), with s₀ = F_c/σ₀"
    source = (
        "Wen (1976), Journal of the Engineering Mechanics Division ASCE 102(2), 249-263; drift of "
        "bristles: Dupont, Hayward, Armstrong, Altpeter (2002), IEEE Transactions on Automatic "
        "Control 47(5), 787-792"
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
        v, h = at.v, at["share"]
        slipping = (rounded_speed(v) * h**3 + v * (h**2 + TINY) ** 1.5) / 2
        return {"share": bristle_rate(slipping, at)}

    def force(self, F: Expression, at: Scope) -> Expression:
        """Replace Coulomb friction by the bristle's."""
        return with_bristle(F, at)
