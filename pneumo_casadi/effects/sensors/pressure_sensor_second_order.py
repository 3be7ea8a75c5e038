"""Pressure sensors behind tubes that swing: a lag of second order."""

from collections.abc import Mapping
from typing import Any

from pneumo_casadi.effects.common.late_pressures import LatePressures, delay
from pneumo_casadi.effects.lags.second_order_lag import second_order_lagged, second_order_rate
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import Parameter


class PressureSensorSecondOrder(LatePressures, Effect):
    """Second-order lag of both pressure sensors: the air in the tube has mass.

    A tube and the volume at its end swing as a Helmholtz resonator, of natural frequency 2ζ/τ.
    """

    name = "pressure_sensor_second_order"
    cause = "pressure_sensor_lag"
    equation = "(τ/2ζ)² ÿ_p + τ ẏ_p + y_p = p, in both chambers"
    source = "tube and transducer; Hougen, Martin and Walsh (1963), Control Engineering 10(9)"
    parameters = (
        delay("delay of a slow pressure, 2ζ/ω_n"),
        Parameter(
            "zeta",
            0.7,
            "1",
            lower=0.3,
            upper=1.5,
            scale=0.2,
            null=0.7,
            start=0.7,
            description="damping of the tube",
            source="0.3-1 for tubes of 1-2 mm, whose walls brake the air",
        ),
    )
    states = tuple(
        State(f"{name}_{c}", unit, scale)
        for c in "PN"
        for name, unit, scale in (("w", "Pa", 1e5), ("g", "Pa/s", 1e6))
    )

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the sensors at the pressures."""
        y = entering["output"]
        return {"w_P": y["p_P"], "g_P": 0.0, "w_N": y["p_N"], "g_N": 0.0}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Let the states follow the pressures."""
        rates = {}
        for c in "PN":
            rates[f"w_{c}"] = at[f"g_{c}"]
            rates[f"g_{c}"] = second_order_rate(entering["output"][f"p_{c}"], *_state(at, c))
        return rates

    def output(self, y: Mapping[str, Expression], at: Scope) -> Mapping[str, Expression]:
        """Show the pressures late."""
        late = {f"p_{c}": second_order_lagged(y[f"p_{c}"], *_state(at, c)) for c in "PN"}
        return {**y, **late}


def _state(at: Scope, c: str) -> tuple[Expression, ...]:
    return at[f"w_{c}"], at[f"g_{c}"], at["tau"], at["zeta"]
