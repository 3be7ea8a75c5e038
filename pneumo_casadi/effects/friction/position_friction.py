"""Position friction: the tube is not the same along the stroke."""

from dataclasses import replace

import casadi as ca

from pneumo_casadi.effects.common.stroke import PLACE
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter

#: What forms of position friction declare.
SOURCE = (
    "Armstrong-Hélouvry (1991), Control of Machines with Friction, Kluwer: friction that depends "
    "on position"
)
SHOWS = "force balance, over the position, with the sign of the velocity"
SEPARATED_BY = "slow full strokes both ways: a load keeps its sign, friction reverses it"
#: Where the sizes of their parameters come from.
TYPICAL = "engineering judgement for cylinders and guides of a few hundred millimetres"


class PositionFriction(Effect):
    """Coulomb friction with a slope over the stroke and a tight spot.

    F = (c x + ΔF exp(-((x - x_t)/w)²)) sign(v).
    """

    name = "position_friction"
    equation = "F = (c x + ΔF exp(−((x − x_t)/w)²)) sign(v)"
    source = SOURCE
    shows = SHOWS
    confused_with = ("F_c_plus", "F_c_minus", "spring_load", "constant_force", "pressure_friction")
    separated_by = SEPARATED_BY
    parameters = (
        Parameter(
            "slope",
            0.0,
            "N/m",
            lower=-1e4,
            upper=1e4,
            scale=20.0,
            null=0.0,
            start=20.0,
            description="change of Coulomb friction along the stroke",
            source=TYPICAL,
        ),
        Parameter(
            "height",
            0.0,
            "N",
            lower=-50.0,
            upper=2000.0,
            scale=10.0,
            null=0.0,
            start=8.0,
            description="extra Coulomb friction in the middle of the tight spot",
            source=TYPICAL,
        ),
        replace(
            PLACE,
            name="centre",
            start=0.02,
            description="middle of the tight spot, from mid-stroke",
            source=TYPICAL,
        ),
        Parameter(
            "width",
            0.03,
            "m",
            lower=0.005,
            upper=0.3,
            scale=0.02,
            null=0.03,
            start=0.03,
            description="distance from the middle at which the tight spot has fallen to 1/e",
            source=TYPICAL,
        ),
    )

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the extra friction."""
        spot = ca.exp(-(((at.x - at["centre"]) / at["width"]) ** 2))
        return F - (at["slope"] * at.x + at["height"] * spot) * at.direction
