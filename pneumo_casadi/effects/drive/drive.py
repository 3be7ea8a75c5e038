"""The drive of a force-driven axis: late, or of another gain than stated."""

from collections.abc import Mapping
from typing import Any

import casadi as ca

from pneumo_casadi.effects.lags.regular_lag import lag_rate, lagged
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter


class DriveLag(Effect):
    """First-order lag between the force asked for and the drive's force."""

    name = "drive_lag"
    equation = "τ Ḟ + F = F_commanded"
    source = "closed current loop as a lag; Leonhard (2001), Control of Electrical Drives"
    shows = "force balance, when the command changes fast"
    confused_with = ("position_delay", "elastic_load", "M")
    separated_by = "a multisine of force up to the drive's bandwidth"
    parameters = (
        Parameter(
            "tau",
            0.0,
            "s",
            lower=0.0,
            upper=0.1,
            scale=2e-3,
            null=0.0,
            start=2e-3,
            description="time constant of the drive",
            source="0.3-10 ms for current loops, engineering judgement",
        ),
    )
    states = (State("F", "N", 50.0),)

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the force commanded."""
        return {"F": entering["drive"]}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Let the state follow the command."""
        return {"F": lag_rate(entering["drive"], at["F"], at["tau"])}

    def drive(self, F: Expression, at: Scope) -> Expression:
        """Let the force come late."""
        return lagged(F, at["F"], at["tau"])


class GainError(Effect):
    """A drive whose gain is not the one stated, F e^γ.

    M, f_v, F_c⁺ and F_c⁻ together absorb it: a fit must hold one of them, the mass for one. In
    F (1 + γ) the gain would be linear and a regression could explain all measured force by
    γ = -1 and an axis of no mass; the exponential, the same to first order, keeps it out.
    """

    name = "gain_error"
    equation = "F = e^γ F_commanded"
    source = "Janot, Gautier, Brunot (2019), Data set and reference models of EMPS: drive gain"
    shows = "nowhere but in the parameters: all of them, by one factor"
    confused_with = ("M", "f_v", "F_c_plus", "F_c_minus")
    separated_by = "a known mass added, or the force measured"
    parameters = (
        Parameter(
            "gamma",
            0.0,
            "1",
            lower=-1.0,
            upper=1.0,
            scale=0.05,
            null=0.0,
            start=0.05,
            description="logarithm of true over stated gain, the relative error where small",
            source="a few per cent for torque constants, engineering judgement",
        ),
    )

    def drive(self, F: Expression, at: Scope) -> Expression:
        """Scale the force."""
        return F * ca.exp(at["gamma"])
