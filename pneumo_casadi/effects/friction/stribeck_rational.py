"""Stribeck friction with a long tail: a film of lubricant that builds up slowly."""

from types import MappingProxyType

from pneumo_casadi.effects.common.breakaway import breakaway_parameters
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression


class StribeckRational(Effect):
    """Extra friction near standstill that decays with speed, slower than an exponential.

    F = delta_F / (1 + (v / v_stribeck)²) sign(v), with delta_F = F_s - F_c. At ten times v_st a
    hundredth is left, where the usual form leaves nothing; drag would have to make up for it.
    """

    name = "stribeck_rational"
    cause = "stribeck"
    equation = "F = ΔF/(1 + (v/v_st)²) sign(v)"
    source = "Hess and Soom (1990), J. Tribology 112(1), 147-152"
    shows = "force balance, below some centimetres a second and at reversals"
    confused_with = ("F_c_plus", "F_c_minus", "f_v", "v_s", "quadratic_drag", "presliding")
    separated_by = "creep at three or more speeds below and above the Stribeck velocity"
    passive = True
    credible = MappingProxyType({"v_stribeck": (0.002, 0.08)})
    parameters = breakaway_parameters("half of it")

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the extra friction."""
        return F - at["delta_F"] / (1 + (at.v / at["v_stribeck"]) ** 2) * at.direction
