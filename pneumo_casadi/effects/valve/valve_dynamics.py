"""Valve dynamics: the spool follows the command as a second-order system, no faster than it can."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

from pneumo_casadi.effects.lags.second_order_lag import second_order_lagged, second_order_rate
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter

TAU = Parameter(
    "tau",
    0.0,
    "s",
    lower=0.0,
    upper=0.1,
    scale=5e-3,
    null=0.0,
    start=5e-3,
    description="delay of a slow command, 2ζ/ω_n",
    source="proportional spool valves of 5-250 Hz at ζ = 0.7: 45 to 0.9 ms",
)
ZETA = Parameter(
    "zeta",
    0.7,
    "1",
    lower=0.3,
    upper=1.5,
    scale=0.2,
    null=0.7,
    start=0.7,
    description="damping of the spool",
    source="0.5-1 for controlled spools",
)
SLEW = Parameter(
    "slew",
    0.0,
    "s/V",
    lower=0.0,
    upper=0.05,
    scale=2e-3,
    free=False,
    null=0.0,
    description="inverse of the greatest speed of the spool",
    source="full stroke of 10 V in 5-50 ms: 0.5-5 ms/V",
)


class ValveDynamics(Effect):
    r"""Second-order spool on both valves, with an optional limit of its speed.

    .. math:: G(s) = \frac{(1 + n s)^2}{(1 + n s)^2 + τ s + (τ/2ζ)^2 s^2},
              \qquad n = \frac{τ_0^2}{τ_0 + τ}, \quad τ_0 = 1 ms

    At τ = 0 poles and zeros cancel: the axis is the nominal one and the derivative to τ that of
    a true lag. n vanishes as τ grows, and what is left is the spool of natural frequency
    ω_n = 2ζ/τ and damping ζ: τ = 9 ms at ζ = 0.7 is 25 Hz. The speed g = ẇ is limited softly to
    g/√(1 + (slew g)²); `slew` is the inverse of the greatest speed and held at zero (no limit)
    unless released, because nothing depends on it at first order there.
    """

    name = "valve_dynamics"
    equation = "spool/u = (1 + ns)²/((1 + ns)² + τs + (τ/2ζ)²s²), ω_n = 2ζ/τ; |ẇ| < 1/slew"
    source = "Richer and Hurmuzlu (2000), J. Dyn. Syst. Meas. Control 122; valve data sheets"
    shows = "both mass flow balances, in proportion to u̇, most after steps of the command"
    confused_with = ("position_delay", "hose", "pressure_sensor_lag", "valve_hysteresis")
    separated_by = "multisine to beyond the spool's bandwidth; steps of several heights for slew"
    command_delays: ClassVar[tuple[str, ...]] = ("tau",)
    parameters: ClassVar[tuple[Parameter, ...]] = (TAU, ZETA, SLEW)
    states = tuple(
        State(f"{name}_{c}", unit) for c in "PN" for name, unit in (("w", "V"), ("g", "V/s"))
    )

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the spool where the command holds it."""
        u = entering["spool"]
        return {"w_P": u.P, "g_P": 0.0, "w_N": u.N, "g_N": 0.0}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Let each spool follow its command."""
        u = entering["spool"]
        slew = at["slew"]
        rates = {}
        for c, command in (("P", u.P), ("N", u.N)):
            g = at[f"g_{c}"]
            rates[f"w_{c}"] = g / (1 + (slew * g) ** 2) ** 0.5
            rates[f"g_{c}"] = second_order_rate(
                command, at[f"w_{c}"], g, self.delay(at, c), at["zeta"]
            )
        return rates

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Return (1 + n s)² w, which is the command where τ = 0."""
        return Pair(
            *(
                second_order_lagged(
                    command, at[f"w_{c}"], at[f"g_{c}"], self.delay(at, c), at["zeta"]
                )
                for c, command in (("P", u.P), ("N", u.N))
            )
        )

    def delay(self, at: Scope, c: str) -> Expression:
        """Return the delay of the valve of chamber c [s]."""
        return at["tau"]


class ValveDynamicsPerValve(ValveDynamics):
    """Second-order spools of which each has its own delay: one is dirty, or a weaker one."""

    name = "valve_dynamics_per_valve"
    cause = "valve_dynamics"
    equation = "as of valve_dynamics, with τ_P in valve P and τ_N in valve N"
    generalises = "valve_dynamics"
    command_delays = ("tau_P", "tau_N")
    parameters = (
        *(replace(TAU, name=f"tau_{c}", description=f"delay of valve {c}, 2ζ/ω_n") for c in "PN"),
        ZETA,
        SLEW,
    )

    def delay(self, at: Scope, c: str) -> Expression:
        """Return the delay of the valve of chamber c [s]."""
        return at[f"tau_{c}"]


class ValveDynamicsLimited(ValveDynamics):
    """Second-order spools whose speed is limited: after steps they go on straight."""

    name = "valve_dynamics_limited"
    cause = "valve_dynamics"
    equation = "as of valve_dynamics, 1/slew estimated from the start"
    generalises = "valve_dynamics"
    parameters = (TAU, ZETA, replace(SLEW, free=True, start=5e-3))
    states = tuple(
        replace(state, scale=100.0 if state.unit == "V/s" else 1.0)  # near its limit
        for state in ValveDynamics.states
    )
