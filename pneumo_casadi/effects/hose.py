"""Hose: the line between valve and chamber delays the flow and takes pressure."""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from pneumo_casadi.effect import Effect, Expression, Pair, Scope, State
from pneumo_casadi.parameters import Parameter

#: Time constant that keeps the null regular [s].
TAU_REGULAR = 1e-3
#: The pressure at the valve is at least this share of that in the chamber.
P_LEAST = 0.02


class Hose(Effect):
    """Line of turbulent resistance R and delay D to each chamber.

    The valve works against p_h, with p_h² = p² + 2 r T R q |q| (compressible Darcy flow), and
    the flow arrives through two equal stages, each (1 + n s)/(1 + (n + D/2) s) with
    n = τ₀²/(τ₀ + D), τ₀ = 1 ms: exactly one at D = 0, with the derivative of a true delay, and
    1/(1 + D s/2)² beyond a few milliseconds. D is the delay of a slow flow: the way of sound,
    L/c (2.9 ms a metre), and the time in which the hose fills through its own resistance. All
    air that enters leaves again. The hose's volume is part of the dead volume, in X_s1 and X_s4.
    """

    name = "hose"
    equation = "p_h² = p² + 2 r T R q|q|, q/q_valve = ((1 + ns)/(1 + (n + D/2)s))²"
    source = "Richer and Hurmuzlu (2000), J. Dyn. Syst. Meas. Control 122, eq. 20 to 29"
    shows = "both mass flow balances: lag after steps of the command, less flow at large ones"
    confused_with = ("valve_dynamics", "position_delay", "flow coefficients", "X_s1", "X_s4")
    separated_by = (
        "steps at both ends of the stroke; sensors at the valve beside those at the chamber"
    )
    parameters = (
        Parameter(
            "R",
            0.0,
            "1/m⁴",
            lower=0.0,
            upper=2e11,
            scale=1e9,
            null=0.0,
            start=5e9,
            description="turbulent resistance, Δp = R q²/ρ",
            source="λ L/(2 d A²): 6e8 (1 m of 8 mm) to 4e10 1/m⁴ (2 m of 4 mm), λ = 0.025",
        ),
        Parameter(
            "delay",
            0.0,
            "s",
            lower=0.0,
            upper=0.1,
            scale=5e-3,
            null=0.0,
            start=6e-3,
            description="delay of the flow",
            source="L/c: 1.5-15 ms for 0.5-5 m",
        ),
    )
    states = tuple(State(f"q{i}_{c}", "kg/s", 5e-3) for c in "PN" for i in (1, 2))

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with a steady flow."""
        q = entering["line"]
        return {"q1_P": q.P, "q2_P": q.P, "q1_N": q.N, "q2_N": q.N}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Pass the flow through two stages."""
        pole, share = _stage(at)
        found = {}
        for c, q in (("P", entering["line"].P), ("N", entering["line"].N)):
            between = q - share * (q - at[f"q1_{c}"])
            found[f"q1_{c}"] = (q - at[f"q1_{c}"]) / pole
            found[f"q2_{c}"] = (between - at[f"q2_{c}"]) / pole
        return found

    def outlet(self, p: Pair, at: Scope) -> Pair:
        """Add the pressure that the hose takes."""
        return Pair(_at_the_valve(p.P, "P", at), _at_the_valve(p.N, "N", at))

    def line(self, q_m: Pair, at: Scope) -> Pair:
        """Return the flow that arrives."""
        return Pair(_arriving(q_m.P, "P", at), _arriving(q_m.N, "N", at))


def _stage(at: Scope) -> tuple[Expression, Expression]:
    """Return the time constant of a stage and how much of its input passes through the state."""
    delay = at["delay"]
    pole = TAU_REGULAR**2 / (TAU_REGULAR + delay) + delay / 2
    return pole, delay / 2 / pole


def _arriving(q: Expression, c: str, at: Scope) -> Expression:
    _, share = _stage(at)
    between = q - share * (q - at[f"q1_{c}"])
    return between - share * (between - at[f"q2_{c}"])


def _at_the_valve(p: Expression, c: str, at: Scope) -> Expression:
    q = at[f"q1_{c}"]
    square = p**2 + 2 * at.axis["r"] * at.axis["T"] * at["R"] * q * ca.fabs(q)
    return ca.sqrt(ca.fmax(square, (P_LEAST * p) ** 2))
