"""Errors of sensors as terms: what a small error of a measured signal changes in the balances.

A sensor that shows s + f shows a motion that the axis has not made. To first order the residuals
change by -(∂r/∂s f + ∂r/∂ṡ ḟ + ∂r/∂s̈ f̈): a linear operator on the samples of f.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.sparse import diags_array

from pneumo_casadi.diagnosis.discover.linear.signals import Signals
from pneumo_casadi.parameters import FloatArray

#: Names of the "balance" of a site that is a sensor's error: of the position, and of the pressure
#: of either chamber.
SENSORS = ("measurement_x", "measurement_P", "measurement_N")


def sensor_operator(signals: Signals, sensor: str, equation: str) -> Any:
    """Return the operator from an error of a sensor (N,) to a residual (N,), sparse.

    Parameters
    ----------
    signals : Signals
        Of one motion.
    sensor : str
        Of `SENSORS`.
    equation : str
        Balance whose residual is asked for.
    """
    slopes = (
        _position_slopes(signals, equation)
        if sensor == "measurement_x"
        else _pressure_slopes(signals, equation, sensor[-1])
    )
    first = _derivative(signals.motion.N, signals.motion.dt)
    operators = {0: diags_array(np.ones(signals.motion.N)), 1: first, 2: first @ first}
    parts = [diags_array(-slope) @ operators[order] for order, slope in slopes.items()]
    return sum(parts[1:], parts[0])


def _position_slopes(signals: Signals, equation: str) -> Mapping[int, FloatArray]:
    """Return ∂r/∂x, ∂r/∂v and ∂r/∂a of a balance, friction constant where the axis moves."""
    values, gain = signals.axis.parameters.as_dict(), signals.gain(equation)
    if equation == "force":
        return {1: -values["f_v"] * gain, 2: -values["M"] * gain}
    p, dp = signals.measured[f"p_{equation[-1]}"], signals.rate(f"p_{equation[-1]}")
    if equation.endswith("P"):
        return {0: -values["X_s2"] * dp * gain, 1: -values["X_s3"] * p * gain}
    return {0: values["X_s5"] * dp * gain, 1: values["X_s6"] * p * gain}


def _pressure_slopes(signals: Signals, equation: str, chamber: str) -> Mapping[int, FloatArray]:
    """Return ∂r/∂p and ∂r/∂ṗ of a balance for the pressure of a chamber."""
    values, gain = signals.axis.parameters.as_dict(), signals.gain(equation)
    if equation == "force":
        side = 1.0 if chamber == "P" else -1.0
        return {0: side * signals.axis.constants[f"S_{chamber}"] * gain}
    if not equation.endswith(chamber):
        return {0: np.zeros(signals.motion.N)}
    displaced = -values["X_s3"] if chamber == "P" else values["X_s6"]
    slope = signals.flow_slope(chamber) + displaced * signals.measured["v"]
    return {0: slope * gain, 1: -np.ones(signals.motion.N)}


def _derivative(N: int, dt: float) -> Any:
    """Return central differences as a sparse operator, zero at both ends."""
    half = np.full(N - 1, 0.5 / dt)
    upper, lower = half.copy(), -half
    upper[0], lower[-1] = 0.0, 0.0
    return diags_array([upper, lower], offsets=[1, -1])
