"""Backlash: the position sensor follows the piston through a play."""

from collections.abc import Mapping
from typing import Any

from pneumo_casadi.effects.common.contact import within
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter

#: Time in which the offset comes back to the edge of the play [s]: a stiff, damped contact.
TAU_CONTACT = 1e-3


class Backlash(Effect):
    """Play between piston and position sensor; the sensor's carriage stays where it is put.

    The offset e between the two may reach half the gap b to each side; beyond it the contact
    takes it back in τ_c::

        ė = v - (e - s(e)) / τ_c,   y = x - s(e)
        s(e) = ½ √((e + b/2)² + ε²) - ½ √((e - b/2)² + ε²)

    s is a clip to ±b/2 with rounded edges: zero at b = 0, where its derivative to b is half the
    sign of the velocity.
    """

    name = "backlash"
    sensors = ("x",)
    hides_motion = True
    equation = "y = x − e, ė = v within |e| < b/2, e = (b/2) sign(v) in contact"
    source = "play operator; Nordin, Gutman (2002), Automatica 38(10), 1633-1649"
    shows = "position, at reversals: it stays for the width of the gap"
    confused_with = ("position_delay", "presliding", "stribeck", "elastic_load")
    separated_by = "dither and reversals of several amplitudes: the gap keeps its width"
    parameters = (
        Parameter(
            "gap",
            0.0,
            "m",
            lower=0.0,
            upper=1e-2,
            scale=2e-4,
            null=0.0,
            start=3e-4,
            description="width b of the play, from contact to contact",
            source="0.05-3 mm, engineering judgement for couplings and clevis pins",
        ),
    )
    states = (State("offset", "m", 1e-3),)

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start in contact on the side towards which the axis moves."""
        return {"offset": at["gap"] / 2 * at.direction + TAU_CONTACT * at.v}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Let the offset run with the piston, and the contact hold it."""
        return {"offset": at.v - (at["offset"] - self._clipped(at)) / TAU_CONTACT}

    def output(self, y: Mapping[str, Expression], at: Scope) -> Mapping[str, Expression]:
        """Subtract the offset from the position shown."""
        return {**y, "x": y["x"] - self._clipped(at)}

    @staticmethod
    def _clipped(at: Scope) -> Expression:
        return within(at["offset"], at["gap"] / 2)
