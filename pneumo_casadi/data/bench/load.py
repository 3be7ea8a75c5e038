"""The load on the rod: inclination of the axis and a constant force."""

from dataclasses import dataclass
from math import radians, sin

from pneumo_casadi.data.bench import quantities

#: Standard acceleration of gravity [m/s²].
GRAVITY = 9.80665


@dataclass(frozen=True, slots=True)
class Load:
    """What acts on the moving mass besides pressures and friction.

    Parameters
    ----------
    angle_deg : float, optional
        Inclination of +x above the horizontal [°]; at 90 gravity acts against +x.
    force : float, optional
        Constant force in +x [N], for example of a spring balancer.

    Raises
    ------
    CaseError
        If a value is not plausible in its unit.

    Examples
    --------
    >>> Load(angle_deg=90.0).acceleration
    -9.80665
    """

    angle_deg: float = 0.0
    force: float = 0.0

    def __post_init__(self) -> None:
        for name, quantity in (("angle_deg", quantities.ANGLE), ("force", quantities.FORCE)):
            value = quantity.check(f"load.{name}", getattr(self, name))
            object.__setattr__(self, name, value)

    @property
    def acceleration(self) -> float:
        """Component of gravity along +x [m/s²]."""
        return -GRAVITY * sin(radians(self.angle_deg)) if self.angle_deg else 0.0
