"""Elastic load whose position is measured: the piston moves before it, on a spring and a damper."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, ClassVar

import casadi as ca

from pneumo_casadi.effects.common.contact import CREDIBLE_PLAY, PLAY, touching, within
from pneumo_casadi.effects.common.progression import PROGRESSION, PROGRESSIONS
from pneumo_casadi.effects.lags.regular_lag import numerator
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.friction_law import friction_force, smoothed_sign
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter

#: A chamber keeps at least this share of the volume that belongs to the measured position.
CAPACITY_LEAST = 0.1
#: √(3 κ) of a spring that does not stiffen [1/N]: Cardano's root needs one.
LEAST_STEEP = 1e-7
#: Of a contact, that a rigid one has no infinite force [m/N]: a thousandth of a stiff one's.
LEAST_COMPLIANCE = 1e-9


class PositionOnElasticLoad(Effect):
    r"""A load of the share s of the mass M, whose position x is measured, on a spring.

    The piston, with the rest of the mass and all friction, is at x_1 = x + δ. With F the sum of
    the forces on the piston and e the spring's force in proportion,

    .. math:: m^2 \ddot e + 2 ζ m \dot e + e = F, \qquad δ = \frac{D^2}{(1 - s) M} e, \qquad
              M \ddot x = e + 2 ζ m \dot e + (n/m)^2 (F - e - 2 ζ m \dot e)

    where 1/D is the natural frequency of the two masses against each other, m = n + D and
    n = τ_0²/(τ_0 + D) with τ_0 = 1 ms, so that at D = 0 the load is rigid, exactly. Both chambers
    see x_1 and its velocity: the flow that would raise the pressure equally at x is

    .. math:: q' = X_{s3} p ẋ + \frac{X_{s1} + X_{s2} x}{X_{s1} + X_{s2} x_1} (q - X_{s3} p ẋ_1).
    """

    name = "position_on_elastic_load"
    cause = "elastic_load"
    equation = "M ẍ = e + 2ζDė, D²ë + 2ζDė + e = F; the piston is at x + D² e/((1 − s) M)"
    source = "two-mass oscillator, Den Hartog (1956), Mechanical Vibrations, ch. 3"
    shows = "all balances, in one band of frequencies: the piston is not where the load is"
    confused_with: ClassVar[tuple[str, ...]] = (
        "elastic_load",
        "position_delay",
        "backlash",
        "X_s2",
        "X_s5",
        "M",
    )
    separated_by = "a second position sensor at the piston; reversals at several accelerations"
    through_states = True
    # Between 70 and 5 Hz in steps of 15 %: wider steps miss the resonance of a light damping. A
    # light load leaves the piston half as far behind as a heavy one.
    scanned: ClassVar[Mapping[str, tuple[float, ...]]] = MappingProxyType(
        {"D": tuple(0.0023 * 1.15**i for i in range(20)), "s": (0.15, 0.5)}
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "D",
            0.0,
            "s",
            lower=0.0,
            upper=0.06,
            scale=2e-3,
            null=0.0,
            start=0.01,
            description="inverse of the natural frequency of the two masses against each other",
            source="3-100 Hz, engineering judgement for couplings and payload mounts",
        ),
        Parameter(
            "s",
            0.5,
            "1",
            lower=0.05,
            upper=0.95,
            scale=0.1,
            null=0.5,
            start=0.5,
            description="share of the moving mass beyond the spring",
            source="payloads weigh about as much as piston, rod and carriage",
        ),
        Parameter(
            "zeta",
            0.05,
            "1",
            lower=0.0,
            upper=1.0,
            scale=0.05,
            null=0.05,
            start=0.05,
            description="damping ratio of the two masses against each other",
            source="0.01-0.1 for metal joints, more with rubber",
        ),
    )
    states = (State("e", "N", 50.0), State("g", "N", 50.0))

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the load moving as the piston does; g is m ė."""
        return {"e": entering["force"], "g": 0.0}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Let the load swing under the force that reaches the piston."""
        F = self._between(entering["force"], at)
        _, m = _times(at)
        return {"e": at["g"] / m, "g": (F - self._through(at)) / m}

    def chamber_energy(self, q_m: Pair, at: Scope) -> Pair:
        """Change the volumes of the chambers with the piston instead of the load."""
        X = [at.axis[f"X_s{i}"] for i in range(1, 7)]
        apart, sliding = _apart(at)
        return Pair(
            _at_the_load(q_m.P, X[0] + X[1] * at.x, X[1] * apart, X[2] * at.p.P, sliding, at),
            _at_the_load(q_m.N, X[3] - X[4] * at.x, -X[4] * apart, -X[5] * at.p.N, sliding, at),
        )

    def force(self, F: Expression, at: Scope) -> Expression:
        """Return the mass times the acceleration that the spring gives to the load."""
        n, m = _times(at)
        through = self._through(at)
        at_load = self._at_load(at)
        return through + (n / m) ** 2 * (self._between(F, at) - through) - at_load

    def _through(self, at: Scope) -> Expression:
        """Return the force of spring and damper, times M over the mass of the load [N]."""
        return self._spring_force(at) + 2 * at["zeta"] * at["g"]

    def _spring_force(self, at: Scope) -> Expression:
        """Return the part of the spring."""
        return at["e"]

    def _between(self, F: Expression, at: Scope) -> Expression:
        """Return the force that parts the two masses, times M over the mass of the load [N]."""
        return _force_on_piston(F, at, 1.0)

    def _at_load(self, at: Scope) -> Expression:
        """Return the friction of the load over its share of the mass [N]; none in this form."""
        return 0.0


class PositionOnGuidedLoad(PositionOnElasticLoad):
    r"""As `PositionOnElasticLoad`, a share φ of the friction being that of the load's own guide.

    The load feels φ f(ẋ), f being the friction of eq. 4, and the piston (1 − φ) f(ẋ_1). With F the
    sum of the forces, φ f(ẋ) and (1 − φ) f(ẋ_1) included,

    .. math:: m^2 \ddot e + 2 ζ m \dot e + e = F' = F + \frac{φ}{s} f(ẋ), \qquad
              M \ddot x = e + 2 ζ m \dot e + (n/m)^2 (F' - e - 2 ζ m \dot e) - \frac{φ}{s} f(ẋ),

    so that a rigid load (D = 0) is moved by F, wherever its friction is.
    """

    name = "position_on_guided_load"
    cause = "elastic_load"
    generalises = "position_on_elastic_load"
    equation = (
        "as `position_on_elastic_load`, with φ f(ẋ) at the load and (1 − φ) f(ẋ_1) at the piston"
    )
    parameters = (
        *PositionOnElasticLoad.parameters,
        Parameter(
            "phi",
            0.0,
            "1",
            lower=0.0,
            upper=1.0,
            scale=0.2,
            null=0.0,
            start=0.3,
            description="share of the friction in the guide of the load",
            source="seals take most of it, guides of heavy loads up to half",
        ),
    )

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the load moving as the piston does, pulled through its own guide."""
        return {"e": entering["force"] + self._at_load(at), "g": 0.0}

    def _between(self, F: Expression, at: Scope) -> Expression:
        return _force_on_piston(F, at, 1 - at["phi"]) + self._at_load(at)

    def _at_load(self, at: Scope) -> Expression:
        return at["phi"] / at["s"] * at.friction


class PositionOnProgressiveLoad(PositionOnGuidedLoad):
    """As `PositionOnGuidedLoad`, on a spring that stiffens as it is stretched, as rubber does.

    The spring pulls e (1 + β δ²) in place of e, with β as of `ElasticLoadProgressive`.
    """

    name = "position_on_progressive_load"
    cause = "elastic_load"
    generalises = "position_on_guided_load"
    equation = "as `position_on_guided_load`, with e (1 + β δ²) in place of e"
    source = "Duffing's spring; Den Hartog (1956), Mechanical Vibrations, ch. 8"
    scanned: ClassVar[Mapping[str, tuple[float, ...]]] = MappingProxyType(
        {**PositionOnGuidedLoad.scanned, "beta": PROGRESSIONS}
    )
    parameters = (*PositionOnGuidedLoad.parameters, PROGRESSION)

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the load moving as the piston does: e (1 + κ e²) is the force through it.

        By Cardano's formula; a spring that softens begins as a linear one.
        """
        F = entering["force"] + self._at_load(at)
        steep = ca.sqrt(3 * ca.fmax(at["beta"], 0) * _compliance(at) ** 2 + LEAST_STEEP**2)
        return {"e": 2 / steep * ca.sinh(ca.asinh(1.5 * steep * F) / 3), "g": 0.0}

    def _spring_force(self, at: Scope) -> Expression:
        stretch, _ = _apart(at)
        return at["e"] * (1 + at["beta"] * stretch**2)


class PositionOnLoadWithPlay(PositionOnGuidedLoad):
    """As `PositionOnGuidedLoad`, with a play b between the two masses.

    The contact pushes by what δ = x_1 - x exceeds ±b/2, and damps in contact alone. A contact that
    does not give (D = 0) has no play.
    """

    name = "position_on_load_with_play"
    cause = "backlash"
    generalises = ""
    hides_motion = True
    credible: ClassVar[Mapping[str, tuple[float, float]]] = MappingProxyType(CREDIBLE_PLAY)
    equation = "as `position_on_guided_load`, with e of what δ exceeds ±b/2"
    source = "two masses with a dead zone; Nordin, Gutman (2002), Automatica 38(10), 1633-1649"
    shows = "all balances, after each braking: the load flies on while the piston turns"
    confused_with = ("elastic_load", "position_delay", "presliding", "stribeck")
    separated_by = "a second position sensor at the piston; reversals of several accelerations"
    scanned: ClassVar[Mapping[str, tuple[float, ...]]] = MappingProxyType(
        {
            "gap": tuple(4e-4 * 1.4**i for i in range(8)),
            "s": (0.35, 0.7),
            "phi": (0.05, 0.4),
            "zeta": (0.4,),
        }
    )
    parameters = (
        replace(
            PositionOnGuidedLoad.parameters[0],
            upper=6e-3,
            start=3e-3,
            source="contacts, over 26 Hz",
        ),
        *PositionOnGuidedLoad.parameters[1:],
        PLAY,
    )

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start in contact on the side that pushes the load: with the contact's force being F."""
        F = entering["force"] + self._at_load(at)
        give = _compliance(at) + LEAST_COMPLIANCE
        rigid, beyond = give / LEAST_COMPLIANCE * ca.fabs(F), ca.fabs(F) + at["gap"] / 2 / give
        return {"e": ca.sign(F) * ca.fmin(rigid, beyond), "g": 0.0}

    def _spring_force(self, at: Scope) -> Expression:
        apart, _ = _apart(at)
        play = within(apart, at["gap"] / 2)
        return at["e"] - play / (_compliance(at) + LEAST_COMPLIANCE)

    def _through(self, at: Scope) -> Expression:
        apart, _ = _apart(at)
        damped = 2 * at["zeta"] * at["g"] * touching(apart, at["gap"] / 2)
        return self._spring_force(at) + damped


def _times(at: Scope) -> tuple[Expression, Expression]:
    """Return n and m [s]."""
    n = numerator(at["D"])
    return n, n + at["D"]


def _apart(at: Scope) -> tuple[Expression, Expression]:
    """Return δ [m] and its rate [m/s]."""
    _, m = _times(at)
    return _compliance(at) * at["e"], _compliance(at) * at["g"] / m


def _compliance(at: Scope) -> Expression:
    """Return δ over e [m/N]."""
    return at["D"] ** 2 / ((1 - at["s"]) * at.axis["M"])


def _force_on_piston(F: Expression, at: Scope, share: Expression) -> Expression:
    """Replace a share of the friction at the velocity of the load by that at the piston's."""
    v, axis = at.v + _apart(at)[1], at.axis
    at_piston = friction_force(v, smoothed_sign(v, axis["v_s"]), axis)
    return F - share * (at_piston - at.friction)


def _at_the_load(
    q: Expression,
    capacity: Expression,
    more: Expression,
    displaced: Expression,
    sliding: Expression,
    at: Scope,
) -> Expression:
    """Return the flow that raises the pressure equally with the piston where the load is."""
    true = ca.fmax(capacity + more, CAPACITY_LEAST * capacity)
    return displaced * at.v + capacity / true * (q - displaced * (at.v + sliding))
