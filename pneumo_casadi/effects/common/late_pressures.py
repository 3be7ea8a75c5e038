"""What all forms of late pressure sensors have in common."""

from typing import ClassVar

from pneumo_casadi.parameters import Parameter


class LatePressures:
    """Both pressure sensors are late by τ, however the air moves in their tubes."""

    sensors: ClassVar[tuple[str, ...]] = ("p_P", "p_N")
    sensor_delays: ClassVar[tuple[str, ...]] = ("tau",)
    shows: ClassVar[str] = "measured pressures, when they change fast"
    confused_with: ClassVar[tuple[str, ...]] = ("hose", "valve_dynamics", "position_delay")
    separated_by: ClassVar[str] = "fast valve steps: the piston answers before the sensor does"
    needs_chambers: ClassVar[bool] = True


def delay(description: str) -> Parameter:
    """Return the parameter τ of late pressure sensors."""
    return Parameter(
        "tau",
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
