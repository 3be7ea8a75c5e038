"""Sensor models: play, delay, filters, errors, noise, quantisation."""

from math import exp, pi, sin
from typing import Any

from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.virtual_bench.kernels.gas import gas_states
from pneumo_casadi.virtual_bench.kernels.jit import kernel
from pneumo_casadi.virtual_bench.kernels.layout import LINE_N, LINE_P, TAP_N, TAP_P, X_2, X_3, X

#: Slots of a sensor's memory: carriage of the position sensor [m], then for the channels P, N
#: and x the input of the filter and the outputs of its two stages.
CARRIAGE, CHANNEL, MEMORY = 0, 1, 10


@kernel
def pressures_at_sensors(y: FloatArray, par: Any) -> Any:
    """Return the pressures where the sensors are tapped [Pa]: at the chambers, or at the valves."""
    if par.hose_volume_V > 0.0 and par.hose_volume_sensor > 0.0:
        return y[LINE_P], y[LINE_N]
    p_P, _, p_N, _ = gas_states(y, par)
    return p_P, p_N


@kernel
def sensor_values(y: FloatArray, par: Any, memory: FloatArray, past: FloatArray, now: int) -> Any:
    """Return the inputs of the filters (p_P, p_N [Pa], x [m]); update the play and the ring buffer.

    `past` is a ring buffer with one position per step, `now` the number of this step.
    """
    if par.pressure_sensor_lag_tau > 0.0:
        p_P, p_N = y[TAP_P], y[TAP_N]
    else:
        p_P, p_N = pressures_at_sensors(y, par)
    cross = par.pressure_crosstalk_share * (p_P - p_N)
    p_P, p_N = p_P - cross, p_N + cross
    half = par.backlash_gap / 2.0
    at = y[X_2] if par.elastic_load_m_2 > 0.0 and par.elastic_load_measured > 0.0 else y[X]
    if par.coupling_m_2 > 0.0 and par.coupling_measured > 0.0:
        at = y[X_3]
    memory[CARRIAGE] = min(max(memory[CARRIAGE], at - half), at + half)
    x = memory[CARRIAGE]
    if par.position_nonlinearity_A > 0.0:
        x += par.position_nonlinearity_A * sin(2.0 * pi * x / par.position_nonlinearity_pitch)
    past[now % past.size] = x
    return p_P + par.pressure_sensor_bias_P, p_N + par.pressure_sensor_bias_N, x


@kernel
def delayed(past: FloatArray, now: int, delay: float) -> Any:
    """Return the position `delay` steps ago [m], interpolated linearly between two steps."""
    whole = int(delay)
    part = delay - whole
    newer, older = past[(now - whole) % past.size], past[(now - whole - 1) % past.size]
    return (1.0 - part) * newer + part * older


@kernel
def filter_step(value: float, at: int, memory: FloatArray, h: float, tau: float) -> Any:
    """Pass a value through two equal lags, exact for an input linear in time; return it."""
    if tau <= 0.0:
        return value
    a = exp(-h / tau)
    slope = value - memory[at]
    new = a * memory[at + 1] + (1.0 - a) * memory[at] + slope * (1.0 - (1.0 - a) * tau / h)
    before = memory[at + 1]
    last = a * memory[at + 2] + (1.0 - a) * before
    last += (new - before) * (1.0 - (1.0 - a) * tau / h)
    memory[at], memory[at + 1], memory[at + 2] = value, new, last
    return last


@kernel
def quantised(value: float, quantum: float) -> Any:
    """Return the nearest multiple of the quantum; the value where there is none."""
    return round(value / quantum) * quantum if quantum > 0.0 else value


@kernel
def observe(
    y: FloatArray, par: Any, memory: FloatArray, past: FloatArray, now: int, h: float,
    shown: FloatArray,
) -> None:  # fmt: skip
    """Fill what the filters give (3,), one step h [s] after the last time."""
    p_P, p_N, x = sensor_values(y, par, memory, past, now)
    if par.position_delay_T > 0.0:
        x = delayed(past, now, par.position_delay_T / h)
    shown[0] = filter_step(p_P, CHANNEL, memory, h, par.sensor_tau)
    shown[1] = filter_step(p_N, CHANNEL + 3, memory, h, par.sensor_tau)
    shown[2] = filter_step(x, CHANNEL + 6, memory, h, par.sensor_tau)


@kernel
def settle(y: FloatArray, par: Any, memory: FloatArray, past: FloatArray) -> None:
    """Initialise the sensors for an axis at rest."""
    memory[CARRIAGE] = y[X]
    for i in range(past.size):
        past[i] = y[X]
    p_P, p_N, x = sensor_values(y, par, memory, past, 0)
    for i in range(past.size):
        past[i] = x
    for i in range(3):
        memory[CHANNEL + i], memory[CHANNEL + 3 + i], memory[CHANNEL + 6 + i] = p_P, p_N, x
