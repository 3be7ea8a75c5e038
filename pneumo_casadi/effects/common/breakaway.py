"""What all forms of friction have in common that falls from breakaway to sliding."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

from pneumo_casadi.parameters import Parameter


class Breakaway:
    """More force breaks the axis away than keeps it sliding, whatever the law of the fall."""

    confused_with: ClassVar[tuple[str, ...]] = (
        "F_c_plus",
        "F_c_minus",
        "f_v",
        "v_s",
        "quadratic_drag",
        "presliding",
    )
    separated_by: ClassVar[str] = (
        "creep at three or more speeds below and above the Stribeck velocity"
    )
    passive: ClassVar[bool] = True
    # A broader decay is asked for by drag that is not linear in the velocity.
    credible: ClassVar[Mapping[str, tuple[float, float]]] = MappingProxyType(
        {"v_stribeck": (0.002, 0.08)}
    )


def breakaway_parameters(fall: str) -> tuple[Parameter, ...]:
    """Return ΔF and v_st; `fall` tells how far the extra friction has fallen at v_st."""
    return (
        Parameter(
            "delta_F",
            0.0,
            "N",
            lower=0.0,
            upper=2000.0,
            scale=10.0,
            null=0.0,
            start=8.0,
            description="breakaway force above the Coulomb friction, F_s - F_c",
            source="5-30 N for pneumatic cylinders of this size, Tran and Yanada (2013)",
        ),
        Parameter(
            "v_stribeck",
            0.02,
            "m/s",
            lower=0.002,
            upper=0.2,
            scale=0.02,
            null=0.02,
            description=f"velocity at which the extra friction has fallen to {fall}",
            source="5-60 mm/s for pneumatic cylinder seals, Tran and Yanada (2013)",
        ),
    )
