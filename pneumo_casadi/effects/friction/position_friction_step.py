"""Position friction that changes at one place of the stroke."""

from dataclasses import replace

import casadi as ca

from pneumo_casadi.effects.common.stroke import PLACE
from pneumo_casadi.effects.friction.position_friction import SEPARATED_BY, SHOWS, SOURCE, TYPICAL
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter


class PositionFrictionStep(Effect):
    """Coulomb friction that is larger beyond one place of the stroke than before it.

    F = (ΔF/2) tanh((x - x_s)/w) sign(v): the edge of a stretch that is worn or dry, a joint of the
    tube, a second bearing that takes over. The mean of both sides is in F_c.
    """

    name = "position_friction_step"
    cause = "position_friction"
    equation = "F = (ΔF/2) tanh((x − x_s)/w) sign(v)"
    source = SOURCE
    shows = SHOWS
    confused_with = ("F_c_plus", "F_c_minus", "position_friction", "pressure_friction")
    separated_by = SEPARATED_BY
    parameters = (
        Parameter(
            "step",
            0.0,
            "N",
            lower=-2000.0,
            upper=2000.0,
            scale=10.0,
            null=0.0,
            start=8.0,
            description="Coulomb friction beyond the edge less that before it",
            source=TYPICAL,
        ),
        replace(
            PLACE, name="edge", description="place of the change, from mid-stroke", source=TYPICAL
        ),
        Parameter(
            "width",
            0.01,
            "m",
            lower=0.001,
            upper=0.1,
            scale=0.01,
            null=0.01,
            start=0.01,
            description="half the length over which friction changes, about",
            source="length of a seal or a bearing, over which they pass an edge",
        ),
    )

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the change of friction."""
        side = ca.tanh((at.x - at["edge"]) / at["width"])
        return F - at["step"] / 2 * side * at.direction
