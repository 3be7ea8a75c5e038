"""Pressure sensors that lag, or show an offset."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar

from pneumo_casadi.effects.common.late_pressures import LatePressures, delay
from pneumo_casadi.effects.lags.regular_lag import lag_rate, lagged
from pneumo_casadi.model.absorption import Absorption
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter


class PressureSensorLag(LatePressures, Effect):
    """First-order lag of both pressure sensors, by their tubing or filters."""

    name = "pressure_sensor_lag"
    equation = "τ ẏ_p + y_p = p, in both chambers"
    source = "pneumatic line as a lag; Andersen (1967), Analysis and Design of Pneumatic Systems"
    parameters: ClassVar[tuple[Parameter, ...]] = (delay("time constant of both sensors"),)
    states = (State("p_P", "Pa", 1e5), State("p_N", "Pa", 1e5))

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Start with the sensors at the pressures."""
        return {name: entering["output"][name] for name in ("p_P", "p_N")}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Let the states follow the pressures."""
        y, taus = entering["output"], self.delays(at)
        return {
            name: lag_rate(y[name], at[name], tau)
            for name, tau in zip(("p_P", "p_N"), taus, strict=True)
        }

    def output(self, y: Mapping[str, Expression], at: Scope) -> Mapping[str, Expression]:
        """Show the pressures late."""
        late = {
            name: lagged(y[name], at[name], tau)
            for name, tau in zip(("p_P", "p_N"), self.delays(at), strict=True)
        }
        return {**y, **late}


class PressureSensorLagPerSensor(PressureSensorLag):
    """First-order lag of each pressure sensor: one sits on the cylinder, the other on a tube."""

    name = "pressure_sensor_lag_per_sensor"
    cause = "pressure_sensor_lag"
    equation = "τ_c ẏ_c + y_c = p_c in chamber c"
    sensor_delays = ("tau_P", "tau_N")
    generalises = "pressure_sensor_lag"
    parameters = tuple(
        delay(f"time constant of the sensor of chamber {c}", f"tau_{c}") for c in "PN"
    )

    def delays(self, at: Scope) -> Pair:
        """Return the delay of each sensor [s]."""
        return Pair(at["tau_P"], at["tau_N"])


class PressureSensorBias(Effect):
    """Offsets of the pressure sensors.

    Between them they look like a constant force, S_P b_P - S_N b_N.
    """

    name = "pressure_sensor_bias"
    sensors = ("p_P", "p_N")
    sensor_offsets = ("b_P", "b_N")
    absorbed_by = Absorption(("F_c",))
    equation = "y_pP = p_P + b_P, y_pN = p_N + b_N"
    source = "zero error of a pressure transmitter, IEC 61298-2"
    shows = "measured pressures, always; in the parameters as a force S_P b_P − S_N b_N"
    confused_with = ("F_c_plus", "F_c_minus", "constant_force", "valve_null_shift", "leakage_P")
    separated_by = "vent both chambers: both sensors must show the ambient pressure"
    needs_chambers = True
    one_form = True
    # Up to a gauge sensor read as absolute; an estimate beyond is another effect's doing.
    credible = MappingProxyType({f"b_{chamber}": (-1.2e5, 1.2e5) for chamber in "PN"})
    parameters = tuple(
        Parameter(
            f"b_{chamber}",
            0.0,
            "Pa",
            lower=-2e5,
            upper=2e5,
            scale=5e3,
            null=0.0,
            start=3e3,
            description=f"what the sensor of chamber {chamber} shows too much",
            source="1-40 kPa: 0.1-4 % of a 10 bar range",
        )
        for chamber in "PN"
    )

    def output(self, y: Mapping[str, Expression], at: Scope) -> Mapping[str, Expression]:
        """Add the offsets."""
        return {**y, "p_P": y["p_P"] + at["b_P"], "p_N": y["p_N"] + at["b_N"]}
