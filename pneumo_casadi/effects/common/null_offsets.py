"""What the forms of a shifted null have in common."""

from pneumo_casadi.parameters import Parameter

#: Effects and parameters with a similar response.
CONFUSED_WITH = (
    "leakage_P",
    "leakage_N",
    "valve_dead_zone",
    "constant_force",
    "flow coefficients",
)
#: The offsets, as the commands at which the valves are open.
OFFSETS = tuple(
    Parameter(
        f"u_0{c}",
        0.0,
        "V",
        lower=-1.0,
        upper=1.0,
        scale=0.05,
        null=0.0,
        start=start,
        description=f"opening of valve {c} at zero command",
        source="0.5-2 % of the command range",
    )
    for c, start in (("P", 0.05), ("N", -0.05))
)
