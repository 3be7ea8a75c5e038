"""Position delay: the position sensor shows where the axis was."""

from collections.abc import Mapping
from typing import Any

from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter

#: Added to the delay in the denominator [s]: without delay, pole and zero cancel.
T_REGULAR = 3e-3


class PositionDelay(Effect):
    """The position T seconds ago, x(t - T) = x - T v̄ with v̄ the mean velocity of that time.

    The mean is a second-order filter of the velocity::

        v̄/v = (1 + n_1 s + n_2 s²) / (1 + d_1 s + d_2 s²)
        d_1 = (T + T_r)/2, d_2 = (T + T_r)²/12, n_1 = T_r/2, n_2 = d_2 - d_1 T/2 + T²/6

    which is the (0, 2) Padé approximant of (1 - e^{-sT})/(sT) for T_r = 0, agrees with it to
    second order in s for any T_r, and is 1 at T = 0: no delay, regularly.
    """

    name = "position_delay"
    sensors = ("x",)
    sensor_delays = ("T",)
    hides_motion = True  # what takes a long delay back leaves a force balance of noise
    equation = "y_x(t) = x(t − T)"
    source = "Padé approximant; Baker, Graves-Morris (1996), Padé Approximants"
    shows = "measured position, in proportion to the velocity"
    confused_with = ("valve_dynamics", "backlash", "pressure_sensor_lag", "hose")
    separated_by = "fast valve steps: pressures answer at once, the position late"
    parameters = (
        Parameter(
            "T",
            0.0,
            "s",
            lower=0.0,
            upper=0.05,
            scale=2e-3,
            null=0.0,
            start=2e-3,
            description="delay of the position",
            source="0.5-15 ms, engineering judgement for digital encoders and filters",
        ),
    )
    states = (State("v_mean", "m/s", 0.5), State("a_mean", "m/s2", 10.0))

    def hides(self, values: Mapping[str, float], bandwidth: float) -> bool:
        """Return whether the delay is too long to be taken back: T ω > 1 within the bandwidth."""
        return values["T"] * bandwidth > 1.0

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start in steady motion."""
        return {"v_mean": at.v, "a_mean": 0.0}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Filter the velocity."""
        return {"v_mean": at["a_mean"], "a_mean": self._change(at)}

    def output(self, y: Mapping[str, Expression], at: Scope) -> Mapping[str, Expression]:
        """Show the position late by the way of the last T seconds."""
        T, total = at["T"], at["T"] + T_REGULAR
        n_2 = total**2 / 12 - total * T / 4 + T**2 / 6
        mean = at["v_mean"] + T_REGULAR / 2 * at["a_mean"] + n_2 * self._change(at)
        return {**y, "x": y["x"] - T * mean}

    @staticmethod
    def _change(at: Scope) -> Expression:
        total = at["T"] + T_REGULAR
        return 12 / total**2 * (at.v - at["v_mean"] - total / 2 * at["a_mean"])
