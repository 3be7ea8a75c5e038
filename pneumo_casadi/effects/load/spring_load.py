"""Spring load: a hose, a cable or a spring that pulls back to mid-stroke."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import ClassVar

import casadi as ca

from pneumo_casadi.effects.common.progression import PROGRESSION
from pneumo_casadi.effects.common.stroke import PLACE
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter

#: Way over which a spring is picked up [m]; keeps derivatives smooth.
ROUNDING = 0.002
STIFFNESS = Parameter(
    "k",
    0.0,
    "N/m",
    lower=0.0,
    upper=1e5,
    scale=100.0,
    null=0.0,
    start=150.0,
    description="stiffness",
    source="100-500 N/m, engineering judgement for hoses and cable chains",
)


class SpringLoad(Effect):
    """A linear spring, F = -k x; its force at mid-stroke is a `constant_force`."""

    name = "spring_load"
    equation = "F = −k x"
    source = "Hooke's law"
    shows = "force balance, over the position, whichever way the axis moves"
    confused_with = ("X_s1", "X_s4", "position_friction", "constant_force", "leakage_P")
    separated_by = "a slow full stroke both ways, or holds at both ends"
    passive = True
    parameters: ClassVar[tuple[Parameter, ...]] = (STIFFNESS,)

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the spring's force."""
        return F - at["k"] * at.x


class SpringLoadProgressive(SpringLoad):
    """A spring that stiffens, or softens, with the way from where it is at rest.

    F = −k (d + β d³) with d = x − x₀: a rolled hose, a leaf or conical spring, a rubber buffer.
    Where β is small, x₀ is a `constant_force` of k x₀. What pushes away from x₀ is no spring.
    """

    name = "spring_load_progressive"
    cause = "spring_load"
    generalises = "spring_load"
    equation = "F = −k (d + β d³), d = x − x₀"
    source = "the first odd terms of any symmetrical spring"
    parameters = (
        STIFFNESS,
        replace(
            PROGRESSION,
            lower=-20.0,
            upper=1e4,
            scale=10.0,
            source="stiffness that doubles within 1 cm to half a metre; some soften by a third",
        ),
        replace(PLACE, description="where the spring is at rest, from mid-stroke"),
    )

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the spring's force."""
        way = at.x - at["x_0"]
        return F - at["k"] * (way + at["beta"] * way**3)


class SpringLoadTwoSided(SpringLoad):
    """A spring that is stiffer on one side of a place of the stroke, or acts there alone.

    F = −k⁺ s(x − x₀) + k⁻ s(x₀ − x) with s(x) = (x + √(x² + w²))/2: a cord or a return spring that
    is slack at first, a bumper, a hose that is stretched one way and hangs the other.
    """

    name = "spring_load_two_sided"
    cause = "spring_load"
    generalises = "spring_load"
    equation = "F = −k⁺ s(x − x₀) + k⁻ s(x₀ − x), s(x) = (x + √(x² + w²))/2, w = 2 mm"
    source = "Hooke's law, of springs that are picked up on the way"
    scanned: ClassVar[Mapping[str, tuple[float, ...]]] = MappingProxyType(
        {"k_minus": (0.0, 300.0), "k_plus": (0.0, 300.0), "x_0": (-0.1, -0.03, 0.0, 0.03, 0.1)}
    )
    parameters = (
        replace(STIFFNESS, name="k_minus", description="stiffness below the place"),
        replace(STIFFNESS, name="k_plus", description="stiffness beyond the place"),
        replace(PLACE, description="place where the stiffness changes, from mid-stroke"),
    )

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the force of the spring on either side."""
        way = at.x - at["x_0"]
        rounded = ca.sqrt(way**2 + ROUNDING**2)
        return F - at["k_plus"] * (rounded + way) / 2 + at["k_minus"] * (rounded - way) / 2
