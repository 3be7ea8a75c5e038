"""A place of the stroke, as effects that depend on the position have one."""

from pneumo_casadi.parameters import Parameter

PLACE = Parameter(
    "x_0",
    0.0,
    "m",
    lower=-1.0,
    upper=1.0,
    scale=0.02,
    null=0.0,
    start=0.0,
    description="place, from mid-stroke",
    source="anywhere in the stroke",
)
