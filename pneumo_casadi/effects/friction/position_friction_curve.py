"""Position friction of any shape: a spline over the stroke."""

from collections.abc import Iterator

import casadi as ca

from pneumo_casadi.effects.friction.position_friction import SEPARATED_BY, SHOWS
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter

#: Number of knots from mid-stroke to either end, and distance of two in strokes: 3 to 4 cm of a
#: usual cylinder, the length of a piston with its bearings, over which friction cannot vary much.
SIDE, SPACING = 6, 1 / 12
#: What first and second differences of the coefficients are divided by, as a prior [N]: friction
#: rises by as much as the Coulomb friction of a small cylinder from one knot to the next, and falls
#: again. What the records pass over overrides it; beyond, the curve levels off within a knot or
#: two. With second differences alone it went on in a straight line, and ended far off where other
#: records pass.
ROUGHNESS = 10.0


class PositionFrictionCurve(Effect):
    r"""Coulomb friction that varies over the stroke, F = Σ c_i B((x − x_i)/d) sign(v).

    B is the cubic B-spline on uniform knots x_i = i d. c_0 is zero: the level of the friction is
    F_c. First and second differences of c have a normal prior (P-spline), so that the curve is
    level and smooth where the records say little.
    """

    name = "position_friction_curve"
    cause = "position_friction"
    equation = "F = Σ c_i B((x − x_i)/d) sign(v), B the cubic B-spline"
    source = "Eilers, Marx (1996), Statistical Science 11(2), 89-121: penalised B-splines"
    shows = SHOWS
    confused_with = ("F_c_plus", "F_c_minus", "position_friction", "pressure_friction")
    separated_by = SEPARATED_BY
    needs_constants = ("stroke",)
    parameters = tuple(
        Parameter(
            f"c_{'minus' if i < 0 else 'plus'}_{abs(i)}",
            0.0,
            "N",
            lower=-3000.0,
            upper=3000.0,
            scale=10.0,
            null=0.0,
            # Linear: a fit needs no start off the null, and a knot that is never passed gets none.
            start=2.0 if abs(i) == 1 else None,
            description=f"extra Coulomb friction about x = {i * SPACING:.3g} strokes",
            source="engineering judgement: up to a few times the Coulomb friction",
        )
        for i in range(-SIDE, SIDE + 1)
        if i
    )

    @classmethod
    def prior_rows(cls) -> Iterator[dict[str, float]]:
        """First and second differences of the coefficients over their standard deviation."""
        names = [item.name for item in cls.parameters]
        names.insert(SIDE, "")  # c_0 is zero
        for difference in ((-1.0, 1.0), (1.0, -2.0, 1.0)):
            for i in range(len(names) + 1 - len(difference)):
                weights = zip(names[i : i + len(difference)], difference, strict=True)
                yield {name: weight / ROUGHNESS for name, weight in weights if name}

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the extra friction."""
        where = at.x / (SPACING * at.axis["stroke"])
        extra: Expression = 0.0
        for item, i in zip(self.parameters, (*range(-SIDE, 0), *range(1, SIDE + 1)), strict=True):
            extra += at[item.name] * _cubic(where - i)
        return F - extra * at.direction


def _cubic(t: Expression) -> Expression:
    """Return the cubic B-spline on the knots -2 to 2; 2/3 at 0."""
    far, near = ca.fmax(2 - ca.fabs(t), 0.0), ca.fmax(1 - ca.fabs(t), 0.0)
    return (far**3 - 4 * near**3) / 6
