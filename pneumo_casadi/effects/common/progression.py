"""How a spring stiffens as it is stretched, which spring loads and elastic loads share."""

from pneumo_casadi.parameters import Parameter

#: Values of β from which the fit of an elastic load begins: rubber stiffens visibly within 3 mm.
PROGRESSIONS = (1e5,)
#: Of a spring whose force is k (δ + β δ³), as in the joint of an elastic load.
PROGRESSION = Parameter(
    "beta",
    0.0,
    "1/m2",
    lower=-1e4,
    upper=1e8,
    scale=1e5,
    null=0.0,
    start=0.0,
    description="progression β of the spring, k (δ + β δ³)",
    source="stiffness that doubles within 0.2-10 mm, as of rubber couplings; some soften",
)
