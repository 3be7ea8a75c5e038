"""Spring load: a hose, a cable or a spring that pulls back to mid-stroke."""

from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter


class SpringLoad(Effect):
    """A linear spring, F = -k x; its force at mid-stroke is a `constant_force`."""

    name = "spring_load"
    equation = "F = −k x"
    source = "Hooke's law"
    shows = "force balance, over the position, whichever way the axis moves"
    confused_with = ("X_s1", "X_s4", "position_friction", "constant_force", "leakage_P")
    separated_by = "a slow full stroke both ways, or holds at both ends"
    passive = True
    parameters = (
        Parameter(
            "k",
            0.0,
            "N/m",
            lower=0.0,
            upper=2e4,
            scale=100.0,
            null=0.0,
            start=150.0,
            description="stiffness",
            source="100-500 N/m, engineering judgement for hoses and cable chains",
        ),
    )

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the spring's force."""
        return F - at["k"] * at.x
