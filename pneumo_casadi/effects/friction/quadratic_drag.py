"""Quadratic drag: a resistance that grows with the square of the speed."""

import casadi as ca

from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter


class QuadraticDrag(Effect):
    """Turbulent drag, F = c v |v|."""

    name = "quadratic_drag"
    equation = "F = c v |v|"
    source = "turbulent resistance of a body in air; Batchelor (1967), Fluid Dynamics"
    shows = "force balance, at high speed"
    confused_with = ("f_v", "stribeck", "asymmetric_viscous_friction", "exhaust_restriction")
    separated_by = "a sweep of constant speeds up to the fastest"
    passive = True
    parameters = (
        Parameter(
            "c",
            0.0,
            "N s2/m2",
            lower=0.0,
            upper=1000.0,
            scale=50.0,
            null=0.0,
            start=40.0,
            description="drag coefficient",
            source="20-200 N s2/m2, engineering judgement",
        ),
    )

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the drag."""
        return F - at["c"] * at.v * ca.fabs(at.v)
