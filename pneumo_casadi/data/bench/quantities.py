"""Plausible ranges of quantities, and the units that are often given instead of SI units.

If a value outside its range would be plausible in one of these units, the error message asks
whether that unit was meant.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pneumo_casadi.errors import CaseError


@dataclass(frozen=True, slots=True)
class Quantity:
    """A physical quantity: its SI unit, plausible range and units often given instead.

    Parameters
    ----------
    unit : str
        How messages name the unit expected.
    lower, upper : float
        Plausible range, bounds included, in `unit`.
    mistaken : mapping of str to (float, float), optional
        Name of another unit -> (scale, offset) with SI value = scale · value + offset.
    """

    unit: str
    lower: float
    upper: float
    mistaken: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def units_that_fit(self, *values: float) -> list[str]:
        """Return the units in which all `values` would be plausible."""
        return [
            unit
            for unit, (scale, offset) in self.mistaken.items()
            if all(self.lower <= scale * value + offset <= self.upper for value in values)
        ]

    def guess(self, *values: float) -> str:
        """Return the units in which all `values` would be plausible, as a question, or ``""``."""
        units = self.units_that_fit(*values)
        return f"is it in {' or '.join(units)}?" if units else ""

    def check(self, name: str, value: object) -> float:
        """Return `value` as a float.

        Raises
        ------
        CaseError
            If it is no finite number or lies outside the plausible range.
        """
        number = as_number(name, value, self.unit)
        if not self.lower <= number <= self.upper:
            raise CaseError(
                f"`{name}`: expected {self.unit} between {self.lower:g} and {self.upper:g}, "
                f"got {number:g}; {self.guess(number) or 'check the value and its unit'}"
            )
        return number


def as_number(name: str, value: object, unit: str) -> float:
    """Return `value` as a finite float.

    Raises
    ------
    CaseError
        If it is no number (text, truth values and None are none) or not finite.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise CaseError(f"`{name}`: expected a number in {unit}, got {value!r}; write it in {unit}")
    number = float(value)
    if not np.isfinite(number):
        raise CaseError(f"`{name}`: expected a finite number in {unit}, got {number}; measure it")
    return number


PRESSURES = {
    "bar": (1e5, 0.0),
    "kPa": (1e3, 0.0),
    "MPa": (1e6, 0.0),
    "psi": (6894.757, 0.0),
}
#: Pressures in the chambers of a moving axis: they exceed at least this share of the supply's gauge
#: pressure, and a closed chamber may be compressed to this multiple of the supply.
CHARGED, COMPRESSION = 0.1, 1.5
USUAL_SUPPLY, USUAL_AMBIENT = 7e5, 101325.0  # absolute Pa, where none is stated
LENGTHS = {"mm": (1e-3, 0.0), "cm": (1e-2, 0.0)}

FREQUENCY = Quantity("Hz", 10.0, 1e6, {"kHz": (1e3, 0.0), "rad/s": (1 / (2 * np.pi), 0.0)})
AREA = Quantity("m²", 1e-6, 0.5, {"cm²": (1e-4, 0.0), "mm²": (1e-6, 0.0)})
STROKE = Quantity("m", 1e-3, 10.0, LENGTHS)
AMBIENT_PRESSURE = Quantity(
    "absolute Pa", 4e4, 1.2e5, PRESSURES | {"gauge Pa": (1.0, USUAL_AMBIENT)}
)
SUPPLY_PRESSURE = Quantity("absolute Pa", 1.2e5, 5e6, PRESSURES)
TEMPERATURE = Quantity("K", 200.0, 500.0, {"°C": (1.0, 273.15)})
GAS_CONSTANT = Quantity("J/(kg K)", 50.0, 5000.0, {"kJ/(kg K)": (1e3, 0.0)})
PRESSURE_NOISE = Quantity("Pa", 0.0, 2e4, PRESSURES)
POSITION_NOISE = Quantity("m", 0.0, 5e-3, LENGTHS)
CONDUCTANCE = Quantity("m³/(s Pa)", 1e-12, 1e-5, {"l/(s bar)": (1e-8, 0.0), "Nl/min": (1e-10, 0.0)})
VELOCITY_NOISE = Quantity("m/s", 0.0, 1.0, {"mm/s": (1e-3, 0.0)})
ACCELERATION_NOISE = Quantity("m/s²", 0.0, 100.0, {"g": (9.80665, 0.0)})
FORCE = Quantity("N", -1e5, 1e5, {"kN": (1e3, 0.0)})
MASS = Quantity("kg", 1e-3, 1e5, {"g": (1e-3, 0.0), "t": (1e3, 0.0)})
ANGLE = Quantity("°", -90.0, 90.0, {"rad": (57.29577951308232, 0.0)})
SHARE = Quantity("a share of 1", 1e-4, 0.5, {"%": (1e-2, 0.0)})

#: Magnitudes of commands [V], and of gains in SI units: amplifiers of servo valves take some volts;
#: a gain beyond these numbers saturates at a nanometre, or gives microvolts over a metre.
LARGEST_COMMAND = 1e3
LEAST_GAIN, LARGEST_GAIN = 1e-6, 1e9

#: Shortest sampling period or tracking time [s]: that of the highest sampling frequency.
SHORTEST = 1 / FREQUENCY.upper


def check_gains(
    controller: object, needed: Mapping[str, str], optional: Mapping[str, str] | None = None
) -> None:
    """Check gains and limits of a controller and store them as floats; `needed` may not be 0."""
    for name, unit in {**needed, **(optional or {})}.items():
        value = as_number(f"controller.{name}", getattr(controller, name), unit)
        object.__setattr__(controller, name, value)
        if name in needed and value == 0.0:
            raise CaseError(f"`controller.{name}`: 0 {unit} closes no loop; give the value used")
        least, most = (0.0, LARGEST_COMMAND) if unit == "V" else (LEAST_GAIN, LARGEST_GAIN)
        if value and not least <= abs(value) <= most:
            raise CaseError(
                f"`controller.{name}`: expected {unit} between {least:g} and {most:g} in "
                f"magnitude, got {value:g}; check the value and its unit"
            )


def check_times(controller: object, *names: str, least: float = SHORTEST) -> None:
    """Check times [s] of a controller that may be None, and store them as floats."""
    for name in names:
        if getattr(controller, name) is not None:
            value = as_number(f"controller.{name}", getattr(controller, name), "s")
            object.__setattr__(controller, name, value)
            if value < least:
                raise CaseError(
                    f"`controller.{name}`: expected at least {least:g} s, got {value:g}; give the "
                    "time in seconds"
                )
