"""A cylinder as its label and the gauges of its supply state it."""

from dataclasses import dataclass
from math import pi

from pneumo_casadi.data.bench.quantities import USUAL_AMBIENT
from pneumo_casadi.errors import CaseError


@dataclass(frozen=True, slots=True)
class Cylinder:
    """What stands on the label of a cylinder and on the gauges of its supply.

    Parameters
    ----------
    piston, rod : float
        Diameters [m].
    stroke : float
        Length [m].
    supply : float
        Supply pressure, absolute [Pa].
    ambient : float, optional
        Ambient pressure, absolute [Pa].
    temperature : float, optional
        Of the air [K].
    double_rod : bool, optional
        Whether the rod goes through both covers.
    gauge : bool, optional
        Whether its pressures were recorded relative to ambient; otherwise names tell, and values
        below ambient in any column of a pressure.

    Examples
    --------
    >>> [round(1e6 * area) for area in Cylinder(0.040, 0.016, 0.5, 7e5).areas]
    [1257, 1056]
    """

    piston: float
    rod: float
    stroke: float
    supply: float
    ambient: float = USUAL_AMBIENT
    temperature: float = 293.15
    double_rod: bool = False
    gauge: bool = False

    def __post_init__(self) -> None:
        if not 0 <= self.rod < self.piston:
            raise CaseError(
                f"rod of {1e3 * self.rod:g} mm in a piston of {1e3 * self.piston:g} mm: give "
                "diameters, the rod's the smaller one"
            )

    @property
    def areas(self) -> tuple[float, float]:
        """S_P and S_N [m²], the rod being on the side of chamber N."""
        annulus = pi / 4 * (self.piston**2 - self.rod**2)
        return (annulus if self.double_rod else pi / 4 * self.piston**2), annulus
