"""How a spring stiffens as it is stretched, which elastic loads share."""

from pneumo_casadi.parameters import Parameter

#: Of a spring whose force is k (δ + β δ³).
PROGRESSION = Parameter(
    "beta",
    0.0,
    "1/m2",
    lower=0.0,
    upper=1e8,
    scale=1e5,
    null=0.0,
    start=1e5,
    description="progression β of the spring, k (δ + β δ³)",
    source="stiffness that doubles within 0.2 to 10 mm, as of rubber couplings",
)
