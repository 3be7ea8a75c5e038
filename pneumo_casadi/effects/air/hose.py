"""Hose: the line between valve and chamber rings and takes pressure."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import casadi as ca

from pneumo_casadi.effects.lags.regular_lag import numerator
from pneumo_casadi.model.absorption import Absorption, Deviation
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter

#: The pressure at the valve is at least this share of that in the chamber.
P_LEAST = 0.02
#: Volume of a chamber that no piston sweeps, over the volume of the whole stroke.
UNSWEPT = 0.1
#: Mean delay below which two hoses of different lengths fade out of the axis [s].
LEAST_DELAY = 1e-6

RESISTANCE = Parameter(
    "R",
    0.0,
    "1/m⁴",
    lower=0.0,
    upper=2e13,
    scale=1e9,
    null=0.0,
    start=5e9,
    description="turbulent resistance, Δp = R q²/ρ",
    source="λ L/(2 d A²): 6e8 (1 m of 8 mm) to 4e10 1/m⁴ (2 m of 4 mm), 5e11 (2 m of 2.5 mm)",
)
DELAY = Parameter(
    "delay",
    0.0,
    "s",
    lower=0.0,
    upper=0.05,
    scale=5e-3,
    null=0.0,
    start=4e-3,
    description="time constant D of the ringing before a large chamber",
    source="2/π L/√(r T): 1.1-11 ms for 0.5-5 m",
)
ZETA = Parameter(
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
)
VOLUME = Parameter(
    "V",
    3e-5,
    "m³",
    lower=0.0,
    upper=1e-3,
    scale=1e-5,
    null=3e-5,
    start=3e-5,
    description="volume of a hose, effective: other dead volumes count in it",
    source="geometry: 14 ml (0.5 m of 6 mm) to 250 ml (5 m of 8 mm)",
)


class Hose(Effect):
    r"""Line of turbulent resistance R that rings in two modes, to each chamber.

    The valve works against p_h, with p_h² = p² + 2 r T R q |q| (compressible Darcy flow). A line
    of volume V before a chamber of volume V_c gives, for what arrives over what would arrive were
    the hose part of the chamber,

    .. math:: G(s) = \prod_{k=1,2} \frac{1 + 2 ζ_k n_k s + n_k^2 s^2}
              {1 + 2 ζ_k m_k s + m_k^2 s^2}, \qquad
              m_k = n_k + D_k, \quad n_k = \frac{τ_0^2}{τ_0 + D_k}, \quad τ_0 = 1 ms,

    The smaller the chamber V_c(x), the faster its hose rings, within 3 % of what the waves do:

    .. math:: D_1 = D \sqrt{\frac{V_c + V/4}{V_c + V}}, \qquad
              D_2 = \frac{D}{3} \sqrt{\frac{V_c + 9 V/64}{V_c + V/4}}, \qquad ζ_k = ζ D_k/D

    V_c is swept by the piston, and a tenth of the whole stroke is added for what no piston sweeps.
    D is 2/π of the time in which sound passes the hose, 2.2 ms a metre at the speed √(r T): before
    a large chamber the modes are a quarter and three quarters of a wave, before none half a wave
    and a whole one. At D = 0 poles and zeros cancel: the axis is the nominal one, exactly. n
    vanishes as D grows. The states are the flow q and the air w = m g + 2ζ m q that is under way,
    with g = m dq/dt: all air that enters leaves again. The hose's volume is part of the dead
    volume, in X_s1 and X_s4.

    D and V stand for each other where a record says little of the ends of the stroke: take neither
    for a length or a volume, however narrow their intervals.
    """

    name = "hose"
    absorbed_by: ClassVar[Absorption | None] = Absorption(("V_P(0)", "V_N(0)"), Deviation.ABOVE)
    equation = (
        "p_h² = p² + 2 r T R q|q|, q/q_valve = Π (1 + 2ζns + n²s²)/(1 + 2ζms + m²s²), m = n + D, "
        "D_1 = D √((V_c + V/4)/(V_c + V)), D_2 = D/3 √((V_c + 9V/64)/(V_c + V/4))"
    )
    source = "Richer and Hurmuzlu (2000), J. Dyn. Syst. Meas. Control 122, eq. 20 to 29"
    shows = "both mass flow balances: ringing after steps of the command, less flow at large ones"
    confused_with = ("valve_dynamics", "position_delay", "flow coefficients", "X_s1", "X_s4")
    separated_by = (
        "steps at both ends of the stroke; sensors at the valve beside those at the chamber"
    )
    # Friction of the small flows that ring: what damps as a controlled spool is the spool.
    credible = MappingProxyType({"zeta": (0.0, 0.5)})
    parameters: ClassVar[tuple[Parameter, ...]] = (RESISTANCE, DELAY, ZETA, VOLUME)
    states = tuple(
        State(f"{name}_{c}", unit, scale)
        for c in "PN"
        for name, unit, scale in (
            ("q", "kg/s", 5e-3),
            ("w", "kg", 1e-5),
            ("q_2", "kg/s", 5e-3),
            ("w_2", "kg", 1e-6),
        )
    )

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with a steady flow."""
        rest: dict[str, Expression] = {}
        for c, q in zip("PN", entering["line"], strict=True):
            for mode in _modes(c, self.sizes(c, at), at):
                rest |= {f"q{mode.name}": q, f"w{mode.name}": 2 * mode.zeta * mode.m * q}
        return rest

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Let the air in the hose swing."""
        rates: dict[str, Expression] = {}
        for c, entered in zip("PN", entering["line"], strict=True):
            q = entered
            for mode in _modes(c, self.sizes(c, at), at):
                rates |= {f"q{mode.name}": mode.g / mode.m, f"w{mode.name}": q - mode.q}
                q = mode.passed(q)
        return rates

    def outlet(self, p: Pair, at: Scope) -> Pair:
        """Add the pressure that the hose takes."""
        pairs = zip("PN", p, strict=True)
        return Pair(*(_at_the_valve(each, self.sizes(c, at).R, c, at) for c, each in pairs))

    def line(self, q_m: Pair, at: Scope) -> Pair:
        """Return the flow that arrives."""
        arriving = []
        for c, q in zip("PN", q_m, strict=True):
            for mode in _modes(c, self.sizes(c, at), at):
                q = mode.passed(q)
            arriving.append(q)
        return Pair(*arriving)

    def sizes(self, c: str, at: Scope) -> "_Sizes":
        """Return what there is of the hose to a chamber."""
        return _Sizes(at["R"], at["delay"], at["V"])


class HosePerChamber(Hose):
    """Hoses of one bore and two lengths: the valve sits nearer to one end. One may be missing.

    R and V are those of a hose of the mean length, with D = (D_P + D_N)/2.
    """

    name = "hose_per_chamber"
    cause = "hose"
    equation = "as of hose, with D_P and D_N; R and V, of the mean length, in proportion to them"
    generalises = "hose"
    absorbed_by = None
    parameters = (
        replace(RESISTANCE, description=f"{RESISTANCE.description}, of a hose of the mean length"),
        *(
            replace(
                DELAY,
                name=f"delay_{c}",
                description=f"time constant D_{c} of the hose to chamber {c}",
            )
            for c in "PN"
        ),
        ZETA,
        replace(VOLUME, description="volume of a hose of the mean length, effective"),
    )

    def sizes(self, c: str, at: Scope) -> "_Sizes":
        """Return what there is of the hose to a chamber."""
        mean = ca.fmax((at["delay_P"] + at["delay_N"]) / 2, LEAST_DELAY)
        share = at[f"delay_{c}"] / mean
        return _Sizes(share * at["R"], at[f"delay_{c}"], share * at["V"])


class _Sizes(NamedTuple):
    """Resistance [1/m⁴], time constant D [s] and volume [m³] of a hose."""

    R: Expression
    delay: Expression
    V: Expression


@dataclass(frozen=True)
class _Mode:
    """One mode of a line: its time constant D_k [s], damping and states."""

    name: str
    delay: Expression
    zeta: Expression
    q: Expression
    w: Expression

    @property
    def m(self) -> Expression:
        """Time constant of the poles."""
        return numerator(self.delay) + self.delay

    @property
    def g(self) -> Expression:
        """The change of the flow, m dq/dt."""
        return self.w / self.m - 2 * self.zeta * self.q

    def passed(self, q: Expression) -> Expression:
        """Return what arrives of a flow that enters."""
        share = numerator(self.delay) / self.m
        swing = 2 * self.zeta * share * (1 - share) * self.g
        return self.q + share**2 * (q - self.q) + swing


def _modes(c: str, of: _Sizes, at: Scope) -> tuple[_Mode, ...]:
    """Return the modes of the line to a chamber, in the order in which a flow passes them."""
    stroke, V = at.axis["stroke"], of.V
    swept = ca.fmax(stroke / 2 + (at.x if c == "P" else -at.x), 0.0)
    chamber = at.axis[f"S_{c}"] * (swept + UNSWEPT * stroke)
    shares = {
        f"_2_{c}": ca.sqrt((chamber + 9 / 64 * V) / (chamber + V / 4)) / 3,
        f"_{c}": ca.sqrt((chamber + V / 4) / (chamber + V)),
    }
    return tuple(
        _Mode(name, of.delay * share, at["zeta"] * share, at[f"q{name}"], at[f"w{name}"])
        for name, share in shares.items()
    )


def _at_the_valve(p: Expression, R: Expression, c: str, at: Scope) -> Expression:
    q = at[f"q_{c}"]
    square = p**2 + 2 * at.axis["r"] * at.axis["T"] * R * q * ca.fabs(q)
    return ca.sqrt(ca.fmax(square, (P_LEAST * p) ** 2))
