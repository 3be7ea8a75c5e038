"""Quadratic drag: a resistance that grows with the square of the speed."""

from dataclasses import replace
from typing import ClassVar

import casadi as ca

from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter

COEFFICIENT = Parameter(
    "c",
    0.0,
    "N s2/m2",
    lower=0.0,
    upper=1e5,
    scale=50.0,
    null=0.0,
    start=40.0,
    description="drag coefficient",
    source="20-200 N s2/m2, engineering judgement",
)


class QuadraticDrag(Effect):
    """Turbulent drag, F = c v |v|."""

    name = "quadratic_drag"
    equation = "F = c v |v|"
    source = "turbulent resistance of a body in air; Batchelor (1967), Fluid Dynamics"
    shows = "force balance, at high speed"
    confused_with = ("f_v", "stribeck", "asymmetric_viscous_friction", "exhaust_restriction")
    separated_by = "a sweep of constant speeds up to the fastest"
    passive = True
    parameters: ClassVar[tuple[Parameter, ...]] = (COEFFICIENT,)

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the drag."""
        return F - at["c"] * at.v * ca.fabs(at.v)


class QuadraticDragPerDirection(QuadraticDrag):
    """Turbulent drag that is stronger one way, as of a damper with a check valve."""

    name = "quadratic_drag_per_direction"
    cause = "quadratic_drag"
    generalises = "quadratic_drag"
    equation = "F = c⁺ v² for v > 0, −c⁻ v² for v < 0"
    source = "turbulent flow through an orifice beside a check valve, as in shock absorbers"
    parameters = (
        replace(COEFFICIENT, name="c_plus", description="drag coefficient forward"),
        replace(COEFFICIENT, name="c_minus", description="drag coefficient backward"),
    )

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the drag of either direction."""
        forward, backward = ca.fmax(at.v, 0.0), ca.fmin(at.v, 0.0)
        return F - at["c_plus"] * forward**2 + at["c_minus"] * backward**2
