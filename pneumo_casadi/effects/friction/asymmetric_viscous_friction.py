"""Asymmetric viscous friction: another slope in each direction of motion."""

from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter


class AsymmetricViscousFriction(Effect):
    """Viscous friction f_v + delta_f_v forward and f_v - delta_f_v backward.

    F = delta_f_v v sign(v) (Janot, Gautier and Brunot 2019, eq. 12, as a difference).
    """

    name = "asymmetric_viscous_friction"
    equation = "F = Δf_v v sign(v)"
    source = (
        "Janot, Gautier, Brunot (2019), Data set and reference models of EMPS, "
        "Workshop on Nonlinear System Identification Benchmarks, eq. 12"
    )
    shows = "force balance, at speed; of one sign whichever way the axis moves"
    confused_with = ("f_v", "F_c_plus", "F_c_minus", "quadratic_drag", "constant_force")
    separated_by = "three or more constant speeds in each direction"
    parameters = (
        Parameter(
            "delta_f_v",
            0.0,
            "N s/m",
            lower=-5000.0,
            upper=5000.0,
            scale=10.0,
            null=0.0,
            start=5.0,
            description="half the difference of the viscous coefficients, forward - backward",
            source="Janot, Gautier, Brunot (2019), Workshop on Nonlinear System Identification",
        ),
    )

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the odd part of the viscous friction."""
        return F - at["delta_f_v"] * at.v * at.direction
