"""Leaks past the piston seal, on all or a part of the stroke, and from either chamber outside."""

from types import MappingProxyType
from typing import ClassVar

import casadi as ca

from pneumo_casadi.model.absorption import Absorption, Deviation
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter
from pneumo_casadi.valve.orifice import RHO_ANR, orifice_expression

#: Critical pressure ratio and subsonic index of a leak. Short gaps have b = 0.2 to 0.5; only leaks
#: between nearly equal pressures depend on b.
B_LEAK, M_LEAK = 0.4, 0.5

SOURCE = (
    "ISO 6358-1:2013, eq. 3 to 5, the leak as a restriction of its own; viscous flow through a "
    "narrow gap goes with the difference of the squared pressures (Poiseuille, isothermal)"
)
#: Fixed unless released: only large leaks at varied pressures determine it.
VISCOUS = Parameter(
    "viscous",
    0.0,
    "1",
    lower=0.0,
    upper=1.0,
    scale=0.3,
    free=False,
    null=0.0,
    description="share of viscous flow at the supply pressure: 0 an orifice, 1 a narrow gap",
    source="0 for holes and fittings, 1 for scratched seals and fits of some 10 µm",
)


def _conductance_parameter(what: str, name: str = "C") -> Parameter:
    return Parameter(
        name,
        0.0,
        "m³/(s Pa)",
        lower=0.0,
        upper=1e-8,
        scale=3e-10,
        null=0.0,
        start=3e-10,
        description=f"sonic conductance {what}",
        source="0.05-1e-9 m³/(s Pa), 0.3 to 6 l/min at 1 bar: seals new to worn",
    )


def _leak(at: Scope, C: Expression, p_1: Expression, p_2: Expression) -> Expression:
    """Return the leak of conductance C from side 1 to side 2 [kg/s].

    Orifice and gap pass the same from the supply to the outside, C ρ₀ p_s.
    """
    p_s, p_ext = at.axis["p_supply"], at.axis["p_ext"]
    gap = C * RHO_ANR * p_s * (p_1**2 - p_2**2) / (p_s**2 - p_ext**2)
    hole = orifice_expression(C, B_LEAK, M_LEAK, p_1, p_2, at.axis["T"])
    return (1 - at["viscous"]) * hole + at["viscous"] * gap


class PistonSealLeakage(Effect):
    """Leak past the piston seal; what leaves one chamber arrives in the other.

    q = C p_1 ρ₀ √(T₀/T) ω(p_2/p_1) from the higher to the lower pressure, or with the share
    `viscous` C ρ₀ p_s (p_1² − p_2²)/(p_s² − p_ext²).
    """

    name = "piston_seal_leakage"
    equation = "q_P −= q, q_N += q, q = C ρ₀ √(T₀/T) max(p_P, p_N) ω(p_P, p_N)"
    source = SOURCE
    shows = "mass flow balances of both chambers, opposite, with the sign of p_P − p_N"
    confused_with = ("leakage_P", "leakage_N", "valve_null_shift", "flow coefficients", "f_v")
    separated_by = "valves closed, different pressures: one chamber rises while the other falls"
    one_form: ClassVar[bool] = True
    parameters: ClassVar[tuple[Parameter, ...]] = (
        _conductance_parameter("past the piston"),
        VISCOUS,
    )

    def chamber_flow(self, q_m: Pair, at: Scope) -> Pair:
        """Move the leak from one chamber to the other."""
        leak = _leak(at, self._conductance(at), at.p.P, at.p.N)
        return Pair(q_m.P - leak, q_m.N + leak)

    def _conductance(self, at: Scope) -> Expression:
        """Return the conductance of the seal where the piston is."""
        return at["C"]


class PistonSealLeakagePerDirection(PistonSealLeakage):
    """Leak past lips of which each seals one direction, with a conductance of its own.

    One of them may be sound: the other turns inside out or is cut.
    """

    name = "piston_seal_leakage_per_direction"
    cause = "piston_seal_leakage"
    equation = "as of piston_seal_leakage, with C_P where p_P > p_N and C_N where p_N > p_P"
    shows = "mass flow balances of both chambers, opposite, most for one sign of p_P − p_N"
    generalises = "piston_seal_leakage"
    parameters = (
        _conductance_parameter("past the piston while p_P is higher", "C_P"),
        _conductance_parameter("past the piston while p_N is higher", "C_N"),
        VISCOUS,
    )

    def _conductance(self, at: Scope) -> Expression:
        """Return the conductance of the lip that the higher pressure lifts."""
        return ca.if_else(at.p.P > at.p.N, at["C_P"], at["C_N"])


class PistonSealLeakageScored(PistonSealLeakage):
    """Leak past the piston seal while it passes a scored part of the tube.

    The conductance of `PistonSealLeakage`, times exp(−((x/l − s)/w)⁴) with the stroke l: of it 94 %
    are left at half of w from the middle s of the score, 1/e at w, less than 1 % at one and a half.
    """

    name = "piston_seal_leakage_scored"
    cause = "piston_seal_leakage"
    equation = "q_P −= q, q_N += q, q = C exp(−((x/l − s)/w)⁴) ρ₀ √(T₀/T) max(p_P, p_N) ω(p_P, p_N)"
    shows = "mass flow balances of both chambers, opposite, on a part of the stroke"
    separated_by = "valves closed at several positions: the leak is found at some of them"
    one_form = False
    needs_constants = ("stroke",)
    # Where the piston passes the score is not felt before there is a leak.
    scanned = MappingProxyType(
        {
            "C": (3e-11, 1e-10, 3e-10, 1e-9),
            "s": tuple(0.08 * i for i in range(-5, 6)),
            "w": (0.05, 0.1, 0.2),
        }
    )
    parameters = (
        *PistonSealLeakage.parameters,
        Parameter(
            "s",
            0.0,
            "1",
            lower=-1.0,
            upper=1.0,
            scale=0.05,
            null=0.0,
            start=0.0,
            description="middle of the scored part, in strokes from mid-stroke",
            source="anywhere in the stroke; beyond it, where the score begins there",
        ),
        # Wider ones are a leak on all of the stroke: of the usual form.
        Parameter(
            "w",
            0.1,
            "1",
            lower=0.02,
            upper=0.5,
            scale=0.05,
            null=0.1,
            start=0.1,
            description="distance from the middle at which 1/e of the leak is left, in strokes",
            source="scores of some centimetres, engineering judgement",
        ),
    )

    def _conductance(self, at: Scope) -> Expression:
        """Return the conductance while the piston passes the score."""
        away = at.x / at.axis["stroke"] - at["s"]
        return at["C"] * ca.exp(-((away / at["w"]) ** 4))


class LeakageP(Effect):
    """Leak from chamber P to the outside, through a fitting or the front cap."""

    name = "leakage_P"
    absorbed_by = Absorption(
        ("S_N/S_P",), Deviation.BELOW, also=("k_P", "k_N", "k_P-k_N", "V_P(0)", "V_N(0)")
    )
    equation = "q_P −= C ρ₀ √(T₀/T) p_P ω(p_ext/p_P)"
    source = SOURCE
    shows = "mass flow balance of chamber P, one sign, in proportion to p_P"
    confused_with = ("piston_seal_leakage", "valve_null_shift", "flow coefficients", "leakage_N")
    separated_by = "valves closed at a held position: p_P decays to p_ext while p_N stays"
    one_form = True
    parameters = (_conductance_parameter("from chamber P to the outside"), VISCOUS)

    def chamber_flow(self, q_m: Pair, at: Scope) -> Pair:
        """Take the leak from chamber P."""
        return Pair(q_m.P - _leak(at, at["C"], at.p.P, at.axis["p_ext"]), q_m.N)


class LeakageN(Effect):
    """Leak from chamber N to the outside, through a fitting or the rod seal."""

    name = "leakage_N"
    absorbed_by = Absorption(
        ("S_N/S_P",), Deviation.ABOVE, also=("k_P", "k_N", "k_P-k_N", "V_P(0)", "V_N(0)")
    )
    equation = "q_N −= C ρ₀ √(T₀/T) p_N ω(p_ext/p_N)"
    source = SOURCE
    shows = "mass flow balance of chamber N, one sign, in proportion to p_N"
    confused_with = ("piston_seal_leakage", "valve_null_shift", "flow coefficients", "leakage_P")
    separated_by = "valves closed at a held position: p_N decays to p_ext while p_P stays"
    one_form = True
    parameters = (_conductance_parameter("from chamber N to the outside"), VISCOUS)

    def chamber_flow(self, q_m: Pair, at: Scope) -> Pair:
        """Take the leak from chamber N."""
        return Pair(q_m.P, q_m.N - _leak(at, at["C"], at.p.N, at.axis["p_ext"]))
