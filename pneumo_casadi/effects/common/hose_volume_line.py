"""Volume at the valve behind a turbulent conductance: what the hoses with a volume share."""

from collections.abc import Mapping

import casadi as ca

from pneumo_casadi.model.effect import Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter
from pneumo_casadi.valve.orifice import orifice_expression

#: Critical pressure ratio and subsonic index of hose and fittings.
B_HOSE, M_HOSE = 0.3, 0.5
#: Volume below which the hose fades out of the axis [m³]: 10 cm of 6 mm bore.
V_REGULAR = 3e-6
#: V_0/C of narrow hoses [s Pa], which fades out below a smaller volume: it fills in 10 ms at 1 bar.
REGULAR_RATIO = 1e3
SOURCE = "mass balance of a volume at one temperature; ISO 6358-1:2013 for hose and fittings"
VOLUME = Parameter(
    "V",
    0.0,
    "m³",
    lower=0.0,
    upper=1e-3,
    scale=2e-5,
    null=0.0,
    start=5e-5,
    description="volume between valve and restriction",
    source="28 ml a metre of 6 mm bore, 50 ml of 8 mm",
)
CONDUCTANCE = Parameter(
    "C",
    6e-9,
    "m³/(s Pa)",
    lower=5e-11,
    upper=1e-7,
    scale=2e-9,
    null=6e-9,
    start=3e-9,  # a wide hose is not felt, and leads no fit to a narrow one
    description="sonic conductance of hose and fittings",
    source="ISO 6358-3 for hoses of 4 to 8 mm, 1 to 5 m: 2e-9 to 3e-8 m³/(s Pa)",
)
LAMINAR = Parameter(
    "ell",
    2e-3,
    "1",
    lower=5e-4,
    upper=0.3,
    scale=2e-3,
    null=2e-3,
    start=2e-3,
    description="share of the pressure lost up to which the flow is laminar",
    source="Reynolds numbers of some thousand: 0.1 % (fittings) to several % (long thin hoses)",
)
PARAMETERS = (VOLUME, CONDUCTANCE, LAMINAR)


def regular_volume(C: Expression) -> Expression:
    """Return the volume V_0 below which a hose of conductance C fades out of the axis [m³].

    V_0 is that of 10 cm of 6 mm bore, or 1e3 s Pa times C if that is less: narrow hoses are small.
    """
    return ca.fmin(V_REGULAR, REGULAR_RATIO * C)


def credible_volume(values: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Return the range of V: a smaller volume is a blend of two axes, and none to be built."""
    return {"V": (float(regular_volume(values["C"])), VOLUME.upper)}


def hose_share(V: Expression, at: Scope) -> Expression:
    """Return the share w of a hose in the model: 0 without a volume, 1 from three V_0 on."""
    return 1 - ca.exp(-V / regular_volume(at["C"]))


def hose_capacity(V: Expression, at: Scope) -> Expression:
    """Return V/(r T) [kg/Pa], which stays positive where the hose fades out."""
    least = regular_volume(at["C"]) * (1 - hose_share(V, at))
    return (V + least) / (at.axis["r"] * at.axis["T"])


def hose_flow(at: Scope, p_h: Expression, p: Expression) -> Expression:
    """Return the flow from the hose at p_h into the chamber at p [kg/s]."""
    return orifice_expression(at["C"], B_HOSE, M_HOSE, p_h, p, at.axis["T"], 1 - at["ell"])
