"""Hose: the line between valve and chamber rings and takes pressure."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import casadi as ca

from pneumo_casadi.effects.common.regular_lag import numerator
from pneumo_casadi.model.absorption import Absorption, Deviation
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter

#: The pressure at the valve is at least this share of that in the chamber.
P_LEAST = 0.02


class Hose(Effect):
    r"""Line of turbulent resistance R that rings with the time constant D, to each chamber.

    The valve works against p_h, with p_h² = p² + 2 r T R q |q| (compressible Darcy flow). One
    cell of inertia L and volume C_l before the chamber's C_c gives, for what arrives over what
    would arrive were the hose part of the chamber,

    .. math:: G(s) = \frac{1 + 2 ζ n s + n^2 s^2}{1 + 2 ζ m s + m^2 s^2},
              \qquad m = n + D, \quad n = \frac{τ_0^2}{τ_0 + D}, \quad τ_0 = 1 ms,

    with 1/D² = (1/C_l + 1/C_c)/L: beside a large chamber D is the way of sound along the hose,
    2.9 ms a metre, beside a small one less. At D = 0 poles and zeros cancel: the axis is the
    nominal one, exactly. n vanishes as D grows. All air that enters leaves again. The hose's
    volume is part of the dead volume, in X_s1 and X_s4.
    """

    name = "hose"
    absorbed_by = Absorption(("V_P(0)", "V_N(0)"), Deviation.ABOVE)
    equation = (
        "p_h² = p² + 2 r T R q|q|, q/q_valve = (1 + 2ζns + n²s²)/(1 + 2ζms + m²s²), m = n + D"
    )
    source = "Richer and Hurmuzlu (2000), J. Dyn. Syst. Meas. Control 122, eq. 20 to 29"
    shows = "both mass flow balances: ringing after steps of the command, less flow at large ones"
    confused_with = ("valve_dynamics", "position_delay", "flow coefficients", "X_s1", "X_s4")
    separated_by = (
        "steps at both ends of the stroke; sensors at the valve beside those at the chamber"
    )
    # Friction of the small flows that ring: what damps as a controlled spool is the spool.
    credible = MappingProxyType({"zeta": (0.0, 0.5)})
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
            upper=0.05,
            scale=5e-3,
            null=0.0,
            start=4e-3,
            description="time constant D of the ringing",
            source="L/c at most: 1.5-15 ms for 0.5-5 m",
        ),
        Parameter(
            "zeta",
            0.1,
            "1",
            lower=0.005,
            upper=1.5,
            scale=0.1,
            null=0.1,
            start=0.1,
            description="damping of the ringing",
            source="16 μ D/(ρ d²) of laminar flow: 0.01 (3 m of 6 mm) to 0.05; flow adds to it",
        ),
    )
    states = tuple(State(f"{name}_{c}", "kg/s", 5e-3) for c in "PN" for name in ("q", "g"))

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with a steady flow."""
        q = entering["line"]
        return {"q_P": q.P, "g_P": 0.0, "q_N": q.N, "g_N": 0.0}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Let the air in the hose swing; g is m dq/dt."""
        _, m = _times(at)
        rates = {}
        for c, q in (("P", entering["line"].P), ("N", entering["line"].N)):
            rates[f"q_{c}"] = at[f"g_{c}"] / m
            rates[f"g_{c}"] = (q - at[f"q_{c}"] - 2 * at["zeta"] * at[f"g_{c}"]) / m
        return rates

    def outlet(self, p: Pair, at: Scope) -> Pair:
        """Add the pressure that the hose takes."""
        return Pair(_at_the_valve(p.P, "P", at), _at_the_valve(p.N, "N", at))

    def line(self, q_m: Pair, at: Scope) -> Pair:
        """Return the flow that arrives."""
        return Pair(_arriving(q_m.P, "P", at), _arriving(q_m.N, "N", at))


def _times(at: Scope) -> tuple[Expression, Expression]:
    """Return n and m [s]."""
    n = numerator(at["delay"])
    return n, n + at["delay"]


def _arriving(q: Expression, c: str, at: Scope) -> Expression:
    n, m = _times(at)
    share = n / m
    swing = 2 * at["zeta"] * share * (1 - share) * at[f"g_{c}"]
    return at[f"q_{c}"] + share**2 * (q - at[f"q_{c}"]) + swing


def _at_the_valve(p: Expression, c: str, at: Scope) -> Expression:
    q = at[f"q_{c}"]
    square = p**2 + 2 * at.axis["r"] * at.axis["T"] * at["R"] * q * ca.fabs(q)
    return ca.sqrt(ca.fmax(square, (P_LEAST * p) ** 2))
