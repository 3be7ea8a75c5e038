"""What all forms of late pressure sensors have in common."""

from typing import ClassVar

from pneumo_casadi.model.effect import Scope
from pneumo_casadi.model.junctions import Pair
from pneumo_casadi.parameters import Parameter


class LatePressures:
    """The pressure sensors are late, however the air moves in their tubes."""

    sensors: ClassVar[tuple[str, ...]] = ("p_P", "p_N")
    sensor_delays: ClassVar[tuple[str, ...]] = ("tau",)
    shows: ClassVar[str] = "measured pressures, when they change fast"
    confused_with: ClassVar[tuple[str, ...]] = ("hose", "valve_dynamics", "position_delay")
    separated_by: ClassVar[str] = "fast valve steps: the piston answers before the sensor does"
    needs_chambers: ClassVar[bool] = True

    def delays(self, at: Scope) -> Pair:
        """Return the delay of each sensor [s]."""
        return Pair(at["tau"], at["tau"])


def delay(description: str, name: str = "tau") -> Parameter:
    """Return a parameter τ of late pressure sensors."""
    return Parameter(
        name,
        0.0,
        "s",
        lower=0.0,
        upper=0.2,
        scale=2e-3,
        null=0.0,
        start=3e-3,
        description=description,
        source="0.5-30 ms, engineering judgement for tapped pressure lines",
    )
