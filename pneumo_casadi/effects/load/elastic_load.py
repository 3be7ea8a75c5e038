"""Elastic load: part of the moving mass hangs on a spring and a damper."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np

from pneumo_casadi.effects.common.progression import PROGRESSION, PROGRESSIONS
from pneumo_casadi.effects.common.second_mass import SecondMass, mass_beyond
from pneumo_casadi.model.absorption import Absorption
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter


class ElasticLoad(SecondMass, Effect):
    """A second mass m_2 at x_2 beyond the mass M that moves with the piston.

    With ω = 2π f and the acceleration of the load a_2::

        a_2 = -ω² (x_2 - x) - 2 ζ ω (v_2 - v),   F = -m_2 a_2

    Written by the load's own frequency and in its own coordinate it is regular at m_2 = 0 and
    does not need the acceleration of the piston. Beside it, M is what moves rigidly.
    """

    name = "elastic_load"
    absorbed_by: ClassVar[Absorption | None] = Absorption(("M",))
    equation = "m_2 ẍ_2 = −m_2 ω² (x_2 − x) − 2 m_2 ζ ω (ẋ_2 − ẋ) = −F, ω = 2π f"
    source = "two-mass oscillator, Den Hartog (1956), Mechanical Vibrations, ch. 3"
    shows = "force balance, in one band of frequencies"
    confused_with = ("M", "backlash", "presliding", "hose")
    separated_by = "a sweep of frequencies at several amplitudes: the resonance stays where it is"
    # A resonance is felt in its own narrow band: a fit that begins beside it finds nothing.
    scanned = MappingProxyType({"f": tuple(1.1**i for i in range(39))})
    parameters: ClassVar[tuple[Parameter, ...]] = (
        mass_beyond("spring"),
        Parameter(
            "f",
            12.0,
            "Hz",
            lower=0.5,
            upper=100.0,
            scale=5.0,
            null=12.0,
            start=12.0,
            description="natural frequency of the load with the piston held",
            source="5-100 Hz for couplings and mounts, 1-3 Hz for hanging loads, judgement",
        ),
        Parameter(
            "zeta",
            0.05,
            "1",
            lower=0.01,
            upper=1.0,
            scale=0.05,
            null=0.05,
            start=0.05,
            description="damping ratio of the load with the piston held",
            source="0.01-0.1 for metal joints, more with rubber",
        ),
    )

    def swings(self, values: Mapping[str, float]) -> tuple[complex, ...]:
        """Return the poles of the load on its spring, the piston held."""
        omega, zeta = 2 * np.pi * values["f"], values["zeta"]
        root = np.emath.sqrt(zeta**2 - 1)
        return tuple(complex(omega * (sign * root - zeta)) for sign in (1, -1))

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the load moving as the piston does."""
        return {"x_2": at.x, "v_2": at.v}

    def _acceleration(self, at: Scope) -> Expression:
        omega, sliding = 2 * np.pi * at["f"], at["v_2"] - at.v
        stretch = self._effective_stretch(at["x_2"] - at.x, at)
        return -(omega**2) * stretch - 2 * at["zeta"] * omega * sliding

    def _effective_stretch(self, stretch: Expression, at: Scope) -> Expression:
        """Return the force of the spring over its stiffness at rest [m]."""
        return stretch


class ElasticLoadProgressive(ElasticLoad):
    """An elastic load on a spring that stiffens as it is stretched, as rubber does.

    With δ = x_2 - x the spring pulls m_2 ω² (δ + β δ³): its stiffness has doubled at δ = 1/√(3 β).
    What `swings` returns holds for small swings.
    """

    name = "elastic_load_progressive"
    cause = "elastic_load"
    generalises = "elastic_load"
    absorbed_by = None  # what parameters take up is told of the usual form
    equation = "m_2 ẍ_2 = −m_2 ω² (δ + β δ³) − 2 m_2 ζ ω δ̇ = −F, δ = x_2 − x, ω = 2π f"
    source = "Duffing's spring; Den Hartog (1956), Mechanical Vibrations, ch. 8"
    separated_by = "a sweep of frequencies at several amplitudes: the resonance moves up with them"
    scanned = MappingProxyType({**ElasticLoad.scanned, "beta": PROGRESSIONS})
    parameters = (*ElasticLoad.parameters, PROGRESSION)

    def _effective_stretch(self, stretch: Expression, at: Scope) -> Expression:
        return stretch * (1 + at["beta"] * stretch**2)
