"""What all loads have in common whose mass moves beside the piston, whatever drives it."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from pneumo_casadi.model.effect import Scope, State
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter


class SecondMass(ABC):
    """A mass m_2 at x_2, which takes from the piston the force that accelerates it."""

    passive: ClassVar[bool] = True
    masses: ClassVar[tuple[str, ...]] = ("m_2",)
    states: ClassVar[tuple[State, ...]] = (State("x_2", "m", 0.1), State("v_2", "m/s", 0.5))

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Accelerate the load."""
        return {"x_2": at["v_2"], "v_2": self._acceleration(at)}

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract what accelerates the load."""
        return F - at["m_2"] * self._acceleration(at)

    @abstractmethod
    def _acceleration(self, at: Scope) -> Expression:
        """Return the acceleration of the load [m/s²]."""


def mass_beyond(what: str) -> Parameter:
    """Return m_2, the mass beyond a spring or a play."""
    return Parameter(
        "m_2",
        0.0,
        "kg",
        lower=0.0,
        upper=100.0,
        scale=2.0,
        null=0.0,
        start=3.0,
        description=f"mass beyond the {what}",
        source="up to the payload of the axis",
    )
