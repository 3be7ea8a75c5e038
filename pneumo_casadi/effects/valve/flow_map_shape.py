"""Flow map shape: openings that are not in proportion to the command."""

from functools import partial
from itertools import pairwise

import casadi as ca

from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.absorption import Absorption
from pneumo_casadi.model.effect import Effect, EffectFactory, Scope
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter

SOURCE = "port windows, rectangular to round: up to 10 % of the flow at half opening"
SIDES = (("minus", -1), ("plus", 1))
#: Where the opening of a metered valve may differ, of the greatest command metered on that side:
#: closest near null, where a flow changes most for what it is. At the end it may not, or the
#: gains of the flow model would say the same.
KNOTS = (0.025, 0.05, 0.1, 0.15, 0.25, 0.4, 0.6)


class FlowMapShape(Effect):
    """Edges that open more, or less, than in proportion to the command.

    The opening is u + c⁺ u² for u > 0 and u − c⁻ u² for u < 0: the first term that eq. 12, affine
    in u on either side, leaves out. Where the static map was metered, `LocalFlowMapShape` takes
    its place: the map shows any shape, and holds it to what the valve was on the bench.
    """

    name = "flow_map_shape"
    absorbed_by = Absorption(("map form",))
    equation = "u −→ u + c⁺ max(u, 0)² − c⁻ min(u, 0)²; on a metered valve, u −→ u + h(u)"
    source = "residuals of eq. 12 at the measured static map"
    shows = "both mass flow balances at large or small openings; residuals of the static map"
    confused_with = ("flow coefficients", "supply_droop", "exhaust_restriction", "valve_dead_zone")
    separated_by = "meter the valve at more commands; amplitudes from small to full opening"
    metered = True
    parameters = tuple(
        Parameter(
            f"c_{side}",
            0.0,
            "1/V",
            lower=-0.05,
            upper=1.0,
            scale=0.02,
            null=0.0,
            start=0.03,
            description=f"bend of the {edge} edge",
            source=SOURCE,
        )
        for side, edge in (("plus", "supply"), ("minus", "exhaust"))
    )

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Bend the opening."""
        return Pair(*(_bent(command, at) for command in u))

    @classmethod
    def on_metered(cls, low: float, high: float) -> EffectFactory:
        """Return the local shape, where both sides of the valve were metered."""
        return partial(LocalFlowMapShape, (-low, high)) if low < 0 < high else cls


def _bent(u: Expression, at: Scope) -> Expression:
    return u + at["c_plus"] * ca.fmax(u, 0.0) ** 2 - at["c_minus"] * ca.fmin(u, 0.0) ** 2


class LocalFlowMapShape(FlowMapShape):
    """Edges of any shape: u −→ u + h(u), with h linear between knots.

    It is zero at null, at the ends of the metered commands and beyond them. It is fitted together
    with the flow coefficients to the metered map, which determines h to a few millivolts.

    Parameters
    ----------
    reach : tuple of float
        Greatest metered command on the exhaust and on the supply side, both positive [V].

    Raises
    ------
    ModelError
        If a side has no reach.

    Examples
    --------
    >>> [item.name for item in LocalFlowMapShape((3.0, 3.0)).parameters[:2]]
    ['h_minus_1', 'h_minus_2']
    """

    def __init__(self, reach: tuple[float, float]) -> None:
        if min(reach) <= 0:
            raise ModelError(
                f"flow_map_shape: metered to {reach[0]:g} V and {reach[1]:g} V beyond null; meter "
                "both sides of the valve to see the shape of both edges"
            )
        self.reach = dict(zip(("minus", "plus"), reach, strict=True))
        self.parameters = tuple(  # type: ignore[misc]
            _height(f"h_{side}_{number}", sign * k * self.reach[side])
            for side, sign in SIDES
            for number, k in enumerate(KNOTS, 1)
        )

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Correct the opening."""
        return Pair(*(command + self.height(command, at) for command in u))

    def height(self, u: Expression, at: Scope) -> Expression:
        """Return h(u) [V]."""
        total: Expression = 0.0
        for side, sign in SIDES:
            end = self.reach[side]
            knots = [0.0, *(k * end for k in KNOTS), end]
            heights = [0.0, *(at[f"h_{side}_{number}"] for number in range(1, len(knots) - 1)), 0.0]
            for (left, right), (h, h_next) in zip(pairwise(knots), pairwise(heights), strict=True):
                share = (ca.fmax(sign * u, left) - left) / (right - left)
                total += (h_next - h) * ca.fmin(share, 1.0)
        return total


def _height(name: str, u: float) -> Parameter:
    """Return h at a command: where it takes most of the opening, it is no shape any more."""
    knot = abs(u)
    return Parameter(
        name,
        0.0,
        "V",
        lower=-0.6 * knot,
        upper=0.6 * knot,
        scale=0.1 * knot,
        null=0.0,
        description=f"opening beyond the command at {u:g} V",
        source=SOURCE,
    )
