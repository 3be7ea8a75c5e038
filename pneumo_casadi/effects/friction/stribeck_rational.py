"""Stribeck friction with a long tail: a film of lubricant that builds up slowly."""

from pneumo_casadi.effects.common.breakaway import Breakaway, breakaway_parameters
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression


class StribeckRational(Breakaway, Effect):
    """Extra friction near standstill that decays with speed, slower than an exponential.

    F = delta_F / (1 + (v / v_stribeck)²) sign(v), with delta_F = F_s - F_c. At ten times v_st a
    hundredth is left, where the usual form leaves nothing; drag would have to make up for it.
    """

    name = "stribeck_rational"
    cause = "stribeck"
    equation = "F = ΔF/(1 + (v/v_st)²) sign(v)"
    source = "Hess and Soom (1990), J. Tribology 112(1), 147-152"
    shows = "force balance, below some centimetres a second and at reversals"
    parameters = breakaway_parameters("half of it")

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the extra friction."""
        return F - at["delta_F"] / (1 + (at.v / at["v_stribeck"]) ** 2) * at.direction
