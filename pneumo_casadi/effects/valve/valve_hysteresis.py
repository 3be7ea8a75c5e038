"""Valve hysteresis: two plays in parallel between command and spool."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import casadi as ca

from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter

#: Time in which the memory of a play follows the command [s].
TAU_MEMORY = 1e-3

H = Parameter(
    "h",
    0.0,
    "V",
    lower=0.0,
    upper=1.0,
    scale=0.05,
    null=0.0,
    start=0.05,
    description="half the width of the loop",
    source="0.2-3 % of the command range",
)
S = Parameter(
    "s",
    0.5,
    "1",
    lower=0.0,
    upper=0.95,
    scale=0.1,
    null=0.5,
    start=0.5,
    description="by what share of h each of the two plays differs from it",
    source="round loops in valve data sheets; engineering judgement",
)


class ValveHysteresis(Effect):
    """Hysteresis of each valve: two plays in parallel between command and spool.

    Their half-widths are h(1 − s) and h(1 + s). A valve's loop is no parallelogram: friction,
    clearance and magnet give way one after another. Two plays make its sides of three straight
    parts, one play (s = 0) of two. With the clip c(e, b) = max(−b, min(e, b))::

        w = u + (c(z₁ − u, h₁) + c(z₂ − u, h₂))/2,   h₁ = h(1 − s), h₂ = h(1 + s)
        żᵢ = −(zᵢ − u − c(zᵢ − u, hᵢ))/τ,            τ = 1 ms

    A memory zᵢ follows the part that the clip cuts off, and does not move inside the play. At
    h = 0 the spool position is exactly the command. Because the memories lag behind u, the
    derivative with respect to h is −sign(u̇), as for ideal play.
    """

    name = "valve_hysteresis"
    equation = "w = u + Σ clip(zᵢ − u, ±hᵢ)/2, żᵢ = −(zᵢ − u − clip(zᵢ − u, ±hᵢ))/τ, hᵢ = h(1 ∓ s)"
    source = "play operator, Visintin (1994), Differential Models of Hysteresis; valve data sheets"
    shows = "both mass flow balances at reversals of the command, the same at every frequency"
    confused_with = ("valve_dynamics", "valve_dead_zone", "position_delay", "valve_null_shift")
    separated_by = "slow sines of several amplitudes: play is a phase lag that falls with amplitude"
    parameters: ClassVar[tuple[Parameter, ...]] = (H, S)
    states = tuple(State(f"z_{c}{i}", "V") for c in "PN" for i in (1, 2))

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start in the middle of the plays."""
        u = entering["spool"]
        return {"z_P1": u.P, "z_P2": u.P, "z_N1": u.N, "z_N2": u.N}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Draw the memories along where the command has left their plays."""
        rates = {}
        for c, u in zip("PN", entering["spool"], strict=True):
            for i, h in enumerate(self.half_widths(at, c), 1):
                e = at[f"z_{c}{i}"] - u
                rates[f"z_{c}{i}"] = -(e - _clip(e, h)) / TAU_MEMORY
        return rates

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Hold the spool within the plays."""
        positions = []
        for c, command in zip("PN", u, strict=True):
            within = [
                _clip(at[f"z_{c}{i}"] - command, h)
                for i, h in enumerate(self.half_widths(at, c), 1)
            ]
            positions.append(command + sum(within) / 2)
        return Pair(*positions)

    def half_widths(self, at: Scope, c: str) -> tuple[Expression, Expression]:
        """Return the half-widths of both plays of the valve of chamber c [V]."""
        return _two_widths(at["h"], at["s"])


class ValveHysteresisPerValve(ValveHysteresis):
    """Hysteresis of which each valve has its own, as where one of them is worn or dirty."""

    name = "valve_hysteresis_per_valve"
    cause = "valve_hysteresis"
    equation = "as of valve_hysteresis, with h_P in valve P and h_N in valve N"
    generalises = "valve_hysteresis"
    parameters = (
        *(replace(H, name=f"h_{c}", description=f"half the width of valve {c}") for c in "PN"),
        S,
    )

    def half_widths(self, at: Scope, c: str) -> tuple[Expression, Expression]:
        """Return the half-widths of both plays of the valve of chamber c [V]."""
        return _two_widths(at[f"h_{c}"], at["s"])


def _two_widths(h: Expression, s: Expression) -> tuple[Expression, Expression]:
    return h * (1 - s), h * (1 + s)


def _clip(e: Expression, h: Expression) -> Expression:
    # As a sum, the clip has a derivative to h where h is zero; nested, it would be a tie.
    return e - ca.fmax(e - h, 0.0) + ca.fmax(-e - h, 0.0)
