"""Backlash between piston and load, whose position is measured at the piston."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np

from pneumo_casadi.effects.common.contact import CREDIBLE_PLAY, PLAY, touching, within
from pneumo_casadi.effects.common.second_mass import SecondMass, mass_beyond
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter


class BacklashBeforeLoad(SecondMass, Effect):
    """A load m_2 that the piston, whose position is measured, pushes through a play.

    With δ = x - x_2 and the play b the contact presses by what δ exceeds ±b/2; s(δ) is δ clipped to
    the play, and ω = 2π f::

        a_2 = ω² (δ - s(δ)) + 2 ζ ω δ̇ in contact, 0 within the play,   F = -m_2 a_2

    The load flies across the play when the piston brakes. Beside it, M is what moves rigidly. A
    contact is fitted softer and more damped than it is, for the measured motion does not resolve
    it; of a load that bounces the play seems narrower, by up to a third on the virtual bench.
    """

    name = "backlash_before_load"
    cause = "backlash"
    equation = "m_2 ẍ_2 = m_2 ω² (δ − s(δ)) + 2 m_2 ζ ω δ̇ in contact = −F, δ = x − x_2, ω = 2π f"
    source = "two masses with a dead zone; Nordin, Gutman (2002), Automatica 38(10), 1633-1649"
    shows = "force balance: the load is missing while it crosses the play, after each braking"
    confused_with = ("elastic_load", "M", "presliding", "stribeck")
    separated_by = "reversals of several accelerations: the load crosses the play in less time"
    hides_motion = True  # that of the load; what the contact does is faster than the balances tell
    credible: ClassVar[Mapping[str, tuple[float, float]]] = MappingProxyType(CREDIBLE_PLAY)
    scanned: ClassVar[Mapping[str, tuple[float, ...]]] = MappingProxyType(
        {
            "m_2": tuple(0.7 * 3.0**i for i in range(4)),
            "gap": tuple(4e-4 * 1.25**i for i in range(13)),
        }
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        mass_beyond("play"),
        replace(PLAY, value=1e-3, lower=1e-5, null=1e-3),  # at m_2 = 0 it does not matter
        Parameter(
            "f",
            12.0,
            "Hz",
            lower=8.0,
            upper=200.0,
            scale=10.0,
            null=12.0,
            start=12.0,
            description="natural frequency of the load in contact with the held piston",
            source="20-100 Hz for pins and couplings that carry a payload, judgement",
        ),
        Parameter(
            "zeta",
            1.0,
            "1",
            lower=0.01,
            upper=3.0,
            scale=0.1,
            null=1.0,
            start=1.0,
            description="damping ratio of the load in contact",
            source="a bounce returns with a half to three quarters of the speed",
        ),
    )

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the load moving as the piston does, pushed by it."""
        return {"x_2": at.x - at["gap"] / 2 * at.direction, "v_2": at.v}

    def _acceleration(self, at: Scope) -> Expression:
        omega, apart, half = 2 * np.pi * at["f"], at.x - at["x_2"], at["gap"] / 2
        damped = 2 * at["zeta"] * omega * (at.v - at["v_2"]) * touching(apart, half)
        return omega**2 * (apart - within(apart, half)) + damped
