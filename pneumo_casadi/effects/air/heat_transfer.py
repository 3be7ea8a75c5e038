"""Heat transfer: mass and energy of the air, and the walls, instead of the polytropic law."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar

import casadi as ca

from pneumo_casadi.model.absorption import Absorption
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter

#: Ratio of specific heats of air.
GAMMA = 1.4
#: The air is taken to be no colder than this share of the wall, whatever an optimiser tries.
T_LEAST = 0.1
#: Piston speed [m/s] at which forced convection is told, and the share of it that still counts as
#: standing still: powers of a speed have no derivative at 0.
V_FORCED, STILL = 0.1, 0.01


class HeatTransfer(Effect):
    r"""Mass and energy balance of each chamber with exchange with its walls.

    With the wall and the supply at T₀ and the air in the chamber at T, the first law
    dU = h_in dm_in − h_out dm_out − p dV + δQ reads::

        V ṗ / (γ r T₀) + p V̇ / (r T₀) = (T_f / T₀) q + (γ − 1) Q / (γ r T₀)
        Ṫ = (γ − 1) T / (p V) (c_p T_f q − c_v T q − p V̇ + Q),   Q = h A(x) (T₀ − T)

    with T_f = T₀ for air that comes in and T for air that goes out, and what a valve lets out
    goes with √(T₀/T), as every orifice does in its upstream temperature (ISO 6358). The
    left-hand side is that of eq. 1 with k = γ, so the right-hand side is the flow that would
    raise the pressure equally. The chamber's volume is read off X_s (V = r T₀ X_s3 (X_s1/X_s2 +
    x)) and its wall area off the bench (two piston areas and the barrel, A = 2 S + 2 √(π S) V/S).

    `share` blends: 0 is the polytropic axis with its own k, exactly; 1 is the first law, where
    k_P = X_s3/X_s2 and k_N = X_s6/X_s5 become the adiabatic γ. So a fit has a check of its
    own: *share at its bound 1 and k near 1.4* confirm heat transfer, and the polytropic fit's k
    between 1 and 1.4 was what the exchange made of it. h → 0 is the adiabatic chamber, h → ∞
    the isothermal one. The air temperatures run along at share = 0 too, without acting, so that
    the derivative to `share` is that of the true heat flow and not of a small one.
    """

    name = "heat_transfer"
    absorbed_by: ClassVar[Absorption | None] = Absorption(("k_P", "k_N", "k_P-k_N"))
    equation = "q −→ q + s ((T/T₀ − 1) min(q, 0) + (γ − 1) h A(x) (T₀ − T)/(γ r T₀)), c_v m Ṫ = …"
    source = (
        "Carneiro and Almeida (2006), Proc. IMechE I 220, 10.1243/09596518JSCE203; "
        "Richer and Hurmuzlu (2000), J. Dyn. Syst. Meas. Control 122"
    )
    shows = "both mass flow balances, 0.2-5 Hz: k rises from 1 to 1.4 with frequency"
    confused_with = ("X_s1", "X_s2", "X_s4", "X_s5", "leakage_P", "leakage_N", "hose")
    separated_by = "charge a chamber at a held piston and close the valve: the pressure creeps back"
    # If heat transfer is the cause, the estimate is 0.95 or more; for a similar cause 0.5 or less.
    credible = MappingProxyType({"share": (0.85, 1.0)})
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "share",
            0.0,
            "1",
            lower=0.0,
            upper=1.0,
            scale=0.5,
            null=0.0,
            start=0.8,
            description="polytropic law (0) to first law (1)",
            source="1 by physics, the upper bound; an estimate below 1 suggests another cause",
        ),
        Parameter(
            "h",
            50.0,
            "W/(m² K)",
            lower=0.0,
            upper=1000.0,
            scale=30.0,
            null=50.0,
            start=50.0,
            description="heat transfer coefficient between air and wall",
            source="20-200 W/(m² K), time constants of 0.05-1 s, Carneiro and Almeida (2006)",
        ),
    )
    states = (State("dT_P", "K", 10.0), State("dT_N", "K", 10.0))

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Energy balance of the air in each chamber, for its temperature above the wall's."""
        q, h = entering["chamber_energy"], self.coefficient(at)
        return {
            "dT_P": _warming(at, "P", h, q.P, at.p.P, at.v),
            "dT_N": _warming(at, "N", h, q.N, at.p.N, -at.v),
        }

    def valve_flow(self, q_m: Pair, at: Scope) -> Pair:
        """Correct the outgoing flow for the temperature of the air: warm air is less dense."""
        return Pair(_thinned(at, "P", q_m.P), _thinned(at, "N", q_m.N))

    def chamber_energy(self, q_m: Pair, at: Scope) -> Pair:
        """Add the heat, and the effect of the outgoing air's temperature on the flow."""
        h = self.coefficient(at)
        return Pair(_equivalent(at, "P", h, q_m.P), _equivalent(at, "N", h, q_m.N))

    def coefficient(self, at: Scope) -> Expression:
        """Return the heat transfer coefficient [W/(m² K)]; constant unless a form has another."""
        return at["h"]


class HeatTransferForced(HeatTransfer):
    """Heat transfer that grows with the speed of the piston, which stirs the air.

    h (1 + b (((v/v₀)² + ε²)^0.4 − ε^0.8)), v₀ = 0.1 m/s, ε = 0.01: forced convection with Reynolds'
    number to the power of 0.8, beside what still air exchanges.
    """

    name = "heat_transfer_forced"
    cause = "heat_transfer"
    generalises = "heat_transfer"
    absorbed_by = None  # what parameters take up is told of the usual form
    equation = "as `heat_transfer`, with h (1 + b |v/v₀|^0.8) in place of h, v₀ = 0.1 m/s"
    source = (
        "Annand (1963), Proc. IMechE 177(1), 973-996: Nusselt's number in cylinders goes with "
        "Reynolds' to the power of 0.7 and more"
    )
    parameters = (
        *HeatTransfer.parameters,
        Parameter(
            "b",
            0.0,
            "1",
            lower=0.0,
            upper=20.0,
            scale=1.0,
            null=0.0,
            start=1.0,
            description="what a piston speed of 0.1 m/s adds to h, over h at standstill",
            source="Re^0.8 of a piston at 0.1-1 m/s against free convection; engineering judgement",
        ),
    )

    def coefficient(self, at: Scope) -> Expression:
        """Return the heat transfer coefficient [W/(m² K)] at the speed of the piston."""
        stirred = ((at.v / V_FORCED) ** 2 + STILL**2) ** 0.4 - STILL**0.8
        return at["h"] * (1 + at["b"] * stirred)


def _geometry(at: Scope, chamber: str) -> tuple[Expression, Expression, Expression]:
    """Return volume [m³], its area [m²] as the flow scale sees it, and the wall [m²]."""
    X = [at.axis[f"X_s{i}"] for i in ((1, 2, 3) if chamber == "P" else (4, 5, 6))]
    S = at.axis[f"S_{chamber}"]
    length = X[0] / X[1] + (at.x if chamber == "P" else -at.x)
    swept = X[2] * at.axis["r"] * at.axis["T"]
    return swept * length, swept, 2 * S + 2 * ca.sqrt(ca.pi * S) * length


def _temperature(at: Scope, chamber: str) -> Expression:
    T_0 = at.axis["T"]
    return ca.fmax(T_0 + at[f"dT_{chamber}"], T_LEAST * T_0)


def _thinned(at: Scope, chamber: str, q: Expression) -> Expression:
    factor = ca.sqrt(at.axis["T"] / _temperature(at, chamber))
    return ca.fmax(q, 0.0) + (1 + at["share"] * (factor - 1)) * ca.fmin(q, 0.0)


def _warming(
    at: Scope, chamber: str, h: Expression, q: Expression, p: Expression, outward: Expression
) -> Expression:
    T_0, dT, r = at.axis["T"], at[f"dT_{chamber}"], at.axis["r"]
    T = _temperature(at, chamber)
    V, S, wall = _geometry(at, chamber)
    heat = -h * wall * dT
    # r/(γ − 1) is c_v; the flow brings c_p T_f and must be brought to c_v T.
    enthalpy = GAMMA * (T_0 * ca.fmax(q, 0.0) + T * ca.fmin(q, 0.0)) - T * q
    power = r / (GAMMA - 1) * enthalpy - p * S * outward + heat
    return (GAMMA - 1) * T / (p * V) * power


def _equivalent(at: Scope, chamber: str, h: Expression, q: Expression) -> Expression:
    T_0, dT, r = at.axis["T"], at[f"dT_{chamber}"], at.axis["r"]
    _, _, wall = _geometry(at, chamber)
    heat = -h * wall * dT
    added = dT / T_0 * ca.fmin(q, 0.0) + (GAMMA - 1) / (GAMMA * r * T_0) * heat
    return q + at["share"] * added
