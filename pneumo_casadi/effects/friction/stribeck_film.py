"""Stribeck friction whose film of lubricant follows the speed with a delay."""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from pneumo_casadi.effects.common.breakaway import Breakaway, breakaway_parameters
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter


class StribeckFilm(Breakaway, Effect):
    """Extra friction that a film of lubricant takes away, which needs time to build up.

    F = delta_F exp(-w / v_stribeck) sign(v) with w the speed that the film has followed so far,
    τ ẇ = |v| - w. After a rest there is more friction than at the same speed in full motion: the
    film is squeezed out. With τ = 0 friction falls exponentially with the speed.
    """

    name = "stribeck_film"
    cause = "stribeck"
    equation = "F = ΔF exp(−w/v_st) sign(v), τ ẇ = |v| − w"
    source = "simplified from Yanada and Sekikawa (2008), Mechatronics 18(7), 330-339"
    shows = "force balance, for some tenths of a second after a rest or a reversal"
    parameters = (
        *breakaway_parameters("1/e"),
        Parameter(
            "tau",
            0.05,
            "s",
            lower=1e-3,
            upper=2.0,
            scale=0.05,
            null=0.05,
            start=0.05,
            description="time in which the film follows the speed",
            source="some hundredths to tenths of a second, engineering judgement",
        ),
    )
    states = (State("w", "m/s", 0.1),)

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the film of the speed."""
        return {"w": at.v * at.direction}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Build the film up, and squeeze it out."""
        return {"w": (at.v * at.direction - at["w"]) / at["tau"]}

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the extra friction."""
        return F - at["delta_F"] * ca.exp(-at["w"] / at["v_stribeck"]) * at.direction
