"""Pressure friction of each seal: that of the rod, and the lips of the piston."""

import casadi as ca

from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter

#: Where the pressure difference turns, its size is rounded [Pa].
ROUNDING = 1e3


def _coefficient(name: str, what: str) -> Parameter:
    return Parameter(
        name,
        0.0,
        "N/Pa",
        lower=0.0,
        upper=4e-3,
        scale=1e-5,
        null=0.0,
        start=1e-5,
        description=f"Coulomb friction per {what}",
        source="5-20 N over 5 bar, after Tran and Yanada (2013)",
    )


class PressureFrictionPerSeal(Effect):
    """Coulomb friction of seals that different pressures press on.

    F = (k_N (p_N − p_ext) + k_Δ |p_P − p_N|) sign(v): the rod seal feels chamber N alone, the lips
    of the piston seal the difference.
    """

    name = "pressure_friction_per_seal"
    cause = "pressure_friction"
    equation = "F = (k_N (p_N − p_ext) + k_Δ |p_P − p_N|) sign(v)"
    source = "Tran, Yanada (2013), Intelligent Control and Automation 4, doi 10.4236/ica.2013.42022"
    shows = "force balance, times the pressure of one chamber, or times their difference"
    confused_with = ("F_c_plus", "F_c_minus", "pressure_friction", "stribeck")
    separated_by = "steps of the pressure of one chamber in motion"
    passive = True
    needs_chambers = True
    parameters = (
        _coefficient("k_N", "gauge pressure of chamber N"),
        _coefficient("k_difference", "pressure difference at the piston"),
    )

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the extra friction."""
        difference = ca.sqrt((at.p.P - at.p.N) ** 2 + ROUNDING**2)
        rod = at["k_N"] * (at.p.N - at.axis["p_ext"])
        return F - (rod + at["k_difference"] * difference) * at.direction
