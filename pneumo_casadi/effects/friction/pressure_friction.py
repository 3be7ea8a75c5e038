"""Pressure friction: seals press harder on the wall under pressure."""

from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter


class PressureFriction(Effect):
    """Coulomb friction that grows with the gauge pressure of both chambers.

    F = k_p (p_P + p_N - 2 p_ext) sign(v).
    """

    name = "pressure_friction"
    equation = "F = k_p (p_P + p_N − 2 p_ext) sign(v)"
    source = "Tran, Yanada (2013), Intelligent Control and Automation 4, doi 10.4236/ica.2013.42022"
    shows = "force balance, times the mean pressure"
    confused_with = ("F_c_plus", "F_c_minus", "stribeck")
    separated_by = "steps of common-mode pressure in motion"
    passive = True
    needs_chambers = True
    parameters = (
        Parameter(
            "k_p",
            0.0,
            "N/Pa",
            lower=0.0,
            upper=2e-3,
            scale=1e-5,
            null=0.0,
            start=1e-5,
            description="Coulomb friction per gauge pressure, both chambers added",
            source="5-20 N over 5 bar, after Tran and Yanada (2013)",
        ),
    )

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the extra friction."""
        gauge = at.p.P + at.p.N - 2 * at.axis["p_ext"]
        return F - at["k_p"] * gauge * at.direction
