"""Noise of the sensors of an axis."""

from dataclasses import dataclass

from pneumo_casadi.data.bench import quantities
from pneumo_casadi.errors import CaseError


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """Standard deviations of the sensors' noise.

    Parameters
    ----------
    p : float
        Of the pressures [Pa]; 0 where there is no pressure sensor.
    x : float
        Of the position [m].
    v : float, optional
        Of the velocity [m/s]; 0 where it is unknown, or there is no such sensor.
    a : float, optional
        Of the acceleration [m/s²]; 0 where it is unknown, or there is no such sensor.

    Raises
    ------
    CaseError
        If a value is negative, not finite or looks like another unit.

    Examples
    --------
    >>> SensorNoise(p=150.0, x=1.5e-5).of("p_N")
    150.0
    """

    p: float
    x: float
    v: float = 0.0
    a: float = 0.0

    def __post_init__(self) -> None:
        for name, quantity in _QUANTITIES.items():
            value = quantity.check(f"noise.{name}", getattr(self, name))
            object.__setattr__(self, name, value)
        if self.x == 0.0:
            raise CaseError("`noise.x`: 0 m; no sensor is exact: give its standard deviation in m")

    def of(self, channel: str) -> float | None:
        """Return the noise of a channel [SI]; None where it is unknown."""
        value: float = getattr(self, "p" if channel in ("p_P", "p_N") else channel, 0.0)
        return value or None


_QUANTITIES = {
    "p": quantities.PRESSURE_NOISE,
    "x": quantities.POSITION_NOISE,
    "v": quantities.VELOCITY_NOISE,
    "a": quantities.ACCELERATION_NOISE,
}
