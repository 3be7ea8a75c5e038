"""The balances in which simulation and measurement can disagree."""

from enum import StrEnum


class Location(StrEnum):
    """A balance of the axis, what its sensors show, or none; values are those of JSON results."""

    MASS_FLOW_P = "mass_flow_P"
    MASS_FLOW_N = "mass_flow_N"
    FORCE = "force"
    MEASUREMENT = "measurement"
    NONE = "none"
