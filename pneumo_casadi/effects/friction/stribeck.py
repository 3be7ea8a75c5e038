"""Stribeck friction: breakaway needs more force than sliding."""

import casadi as ca

from pneumo_casadi.effects.common.breakaway import Breakaway, breakaway_parameters
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression


class Stribeck(Breakaway, Effect):
    """Extra friction near standstill that decays with speed.

    F = delta_F exp(-(v / v_stribeck)²) sign(v), with delta_F = F_s - F_c.
    """

    name = "stribeck"
    equation = "F = ΔF exp(−(v/v_st)²) sign(v)"
    source = "Armstrong-Hélouvry, Dupont, Canudas de Wit (1994), Automatica 30(7), 1083-1138"
    shows = "force balance, below a few centimetres a second and at reversals"
    parameters = breakaway_parameters("1/e")

    def force(self, F: Expression, at: Scope) -> Expression:
        """Subtract the extra friction."""
        return F - at["delta_F"] * ca.exp(-((at.v / at["v_stribeck"]) ** 2)) * at.direction
