"""Constant force: a tilted axis, a hanging weight."""

from pneumo_casadi.model.absorption import Absorption
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter


class ConstantForce(Effect):
    """A force that neither motion nor pressure changes.

    F_c⁺ - F_c⁻ of the nominal axis absorbs it: a fit must hold one of the three.
    """

    name = "constant_force"
    absorbed_by = Absorption(("F_c",))
    equation = "F = F_0, in +x"
    source = "weight of the moving mass on a tilted axis, M g sin(tilt)"
    shows = "force balance, always; in the parameters only, as F_c_plus − F_c_minus"
    confused_with = ("F_c_plus", "F_c_minus", "pressure_sensor_bias", "spring_load")
    separated_by = "turn the axis round, or vent both chambers and see whether it moves"
    one_form = True
    parameters = (
        Parameter(
            "F_0",
            0.0,
            "N",
            lower=-2e4,
            upper=2e4,
            scale=10.0,
            null=0.0,
            start=5.0,
            description="force in +x",
            source="1-20 N: a tilt of a degree or two under 10-50 kg",
        ),
    )

    def force(self, F: Expression, at: Scope) -> Expression:
        """Add the force."""
        return F + at["F_0"]
