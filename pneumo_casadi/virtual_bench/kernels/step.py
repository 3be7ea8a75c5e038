"""Time stepping: Runge-Kutta between events, which are located to machine precision.

Within a step the piston moves one way or is held. Where it would turn, break away or meet a
stop, the step is cut at that instant; so friction is a set-valued sign, and no stop is crossed.
"""

from math import pi, sin
from typing import Any

from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.virtual_bench.kernels import layout
from pneumo_casadi.virtual_bench.kernels.gas import (
    chamber_rates,
    enthalpy,
    gas_states,
    gland_leakage,
    seal_leakage,
)
from pneumo_casadi.virtual_bench.kernels.jit import kernel
from pneumo_casadi.virtual_bench.kernels.layout import (
    DOWN,
    FREE,
    HELD,
    LINE_N,
    LINE_P,
    SIZE,
    UP,
    V,
    X,
)
from pneumo_casadi.virtual_bench.kernels.motion import (
    applied_force,
    film_rates,
    friction,
    friction_levels,
    holding_limits,
    load_rates,
    piston_mass,
    write_bristles,
)
from pneumo_casadi.virtual_bench.kernels.ports import line_rates, port_pressures, port_rates
from pneumo_casadi.virtual_bench.kernels.sensors import pressures_at_sensors
from pneumo_casadi.virtual_bench.kernels.valve import spools, valve_flows

#: Events within one step before it is taken as it is; two or three happen.
MOST_EVENTS = 30
#: Nodes, weights and reach of the classical Runge-Kutta method of fourth order.
NODES, WEIGHTS, NEXT = (0.0, 0.5, 0.5, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6), (0.5, 0.5, 1.0, 0.0)
#: Width to which the instant of an event is bracketed, in steps.
INSTANT = 1e-13


@kernel
def gas_flows(
    t: float, y: FloatArray, dy: FloatArray, par: Any, target: FloatArray, p_P: float, T_P: float,
    p_N: float, T_N: float,
) -> Any:  # fmt: skip
    """Fill the rates of valves, ports and lines; return flows and enthalpy flows at the chambers.

    In order: q_P, q_N [kg/s], H_P, H_N [W], gas entering chambers and lines from outside [kg/s].
    """
    s_P, s_N = spools(target, y, dy, par)
    p_s, p_e = port_pressures(t, y, par)
    long = par.hose_length > 0.0 or par.hose_volume_V > 0.0
    at_P, at_N = (y[LINE_P], y[LINE_N]) if long else (p_P, p_N)
    up_P, up_N = (par.T, par.T) if long else (T_P, T_N)
    drift = 1.0
    if par.flow_drift_share != 0.0:
        drift += par.flow_drift_share * (1.0 - 1.0 / (1.0 + max(t, 0.0) / par.flow_drift_tau))
    b_more = par.flow_map_shape_fittings_b
    in_P, out_P = valve_flows(par, s_P, at_P, up_P, p_s, p_e, 1.0, b_more)
    gain = 1.0 + par.valve_mismatch_gain
    in_N, out_N = valve_flows(par, s_N, at_N, up_N, p_s, p_e, gain, b_more)
    in_P, out_P, in_N, out_N = drift * in_P, drift * out_P, drift * in_N, drift * out_N
    port_rates(y, dy, par, in_P + in_N, out_P + out_N)
    q_P, q_N = in_P - out_P, in_N - out_N
    entering = q_P + q_N
    if long:
        q_P = line_rates(LINE_P, q_P, p_P, T_P, y, dy, par)
        q_N = line_rates(LINE_N, q_N, p_N, T_N, y, dy, par)
        H_P, H_N = enthalpy(q_P, par.T, T_P, par), enthalpy(q_N, par.T, T_N, par)
    else:
        H_P = enthalpy(in_P, par.T, T_P, par) + enthalpy(-out_P, par.T, T_P, par)
        H_N = enthalpy(in_N, par.T, T_N, par) + enthalpy(-out_N, par.T, T_N, par)
    return q_P, q_N, H_P, H_N, entering


@kernel
def rates(
    t: float, y: FloatArray, dy: FloatArray, par: Any, mode: int, target: FloatArray,
    bristles: FloatArray,
) -> None:  # fmt: skip
    """Fill dy = f(t, y) while the piston is in `mode`."""
    p_P, T_P, p_N, T_N = gas_states(y, par)
    F, gas = applied_force(t, y, p_P, p_N, par)
    dy[X], dy[V] = y[V], 0.0
    if mode != HELD:
        up, down = friction_levels(t, y, p_P, p_N, par)
        F -= friction(mode, up, down, y, bristles, par)
        dy[V] = F / piston_mass(par)
    load_rates(y, dy, par)
    film_rates(y, dy, par)
    q_P, q_N, H_P, H_N, entering = gas_flows(t, y, dy, par, target, p_P, T_P, p_N, T_N)
    seal = seal_leakage(y[X], p_P, p_N, par)
    away_P = gland_leakage(par.leakage_P_q, par.leakage_P_orifice, p_P, par)
    away_N = gland_leakage(par.leakage_N_q, par.leakage_N_orifice, p_N, par)
    if par.periodic_leak_q > 0.0:
        open_ = (1.0 + sin(2.0 * pi * y[X] / par.periodic_leak_pitch)) / 2.0
        away_P += open_ * gland_leakage(par.periodic_leak_q, 0.0, p_P, par)
    lost_P, lost_N = enthalpy(-away_P, par.T, T_P, par), enthalpy(-away_N, par.T, T_N, par)
    H_seal = enthalpy(seal, T_P, T_N, par)
    heat = chamber_rates(
        y, dy, par, q_P - seal - away_P, q_N + seal - away_N,
        H_P + lost_P - H_seal, H_N + lost_N + H_seal,
    )  # fmt: skip
    dy[layout.IN_MASS] = entering - away_P - away_N
    dy[layout.IN_ENERGY] = H_P + H_N + lost_P + lost_N + heat
    dy[layout.LOST_WORK] = (gas - F) * y[V]
    if par.pressure_sensor_lag_tau > 0.0:
        tapped_P, tapped_N = pressures_at_sensors(y, par)
        tap_rates(layout.TAP_P, tapped_P, y, dy, par)
        tap_rates(layout.TAP_N, tapped_N, y, dy, par)


@kernel
def tap_rates(at: int, p: float, y: FloatArray, dy: FloatArray, par: Any) -> None:
    """Fill the rates of a sensor behind its tube: second order, 2ζ/ω = τ, ζ = 0.7."""
    tau = par.pressure_sensor_lag_tau
    if at == layout.TAP_N:
        tau *= par.pressure_sensor_lag_at_N
    if par.pressure_sensor_lag_first_order > 0.0:
        dy[at] = (p - y[at]) / tau
        return
    omega = 1.4 / tau
    dy[at] = y[at + 1]
    dy[at + 1] = omega * omega * (p - y[at]) - 1.4 * omega * y[at + 1]


@kernel
def copy(source: FloatArray, target: FloatArray) -> None:
    """Write an array over another of its length.

    Numba takes half a second to compile an assignment to a slice, hence the loops here and
    where sensors and lines are filled.
    """
    for i in range(target.size):
        target[i] = source[i]


@kernel
def runge_kutta(
    t: float, h: float, y: FloatArray, after: FloatArray, work: FloatArray, par: Any, mode: int,
    target: FloatArray, bristles: FloatArray,
) -> None:  # fmt: skip
    """Fill `after` with the state a step h [s] later; fourth order, `work` is (4, SIZE)."""
    total, at, dy = work[0], work[1], work[2]
    copy(y, at)
    for stage in range(4):  # in a loop: the right-hand side is compiled into one place only
        rates(t + NODES[stage] * h, at, dy, par, mode, target, bristles)
        for i in range(SIZE):
            total[i] = WEIGHTS[stage] * dy[i] + (total[i] if stage > 0 else 0.0)
            at[i] = y[i] + h * NEXT[stage] * dy[i]
    for i in range(SIZE):
        after[i] = y[i] + h * total[i]


@kernel
def excess(t: float, y: FloatArray, par: Any, bristles: FloatArray) -> Any:
    """Return by how much the force on the piston at rest exceeds what holds it [N], signed."""
    p_P, _, p_N, _ = gas_states(y, par)
    F, _ = applied_force(t, y, p_P, p_N, par)
    up, down = holding_limits(t, y, p_P, p_N, bristles, par)
    return F - up if up < F else F + down if -down > F else 0.0


@kernel
def margin(t: float, y: FloatArray, par: Any, mode: int, bristles: FloatArray) -> Any:
    """Return a number that turns negative where the piston leaves its mode."""
    if mode == HELD:
        return -abs(excess(t, y, par, bristles))
    stop = (par.half - abs(y[X])) / par.half
    if mode == FREE:
        return stop
    stop = (par.half - mode * y[X]) / par.half
    return min(mode * y[V], stop)


@kernel
def switched(t: float, y: FloatArray, par: Any, mode: int, bristles: FloatArray) -> Any:
    """Put the state at an event to rights and return the mode that follows."""
    if abs(y[X]) >= par.half * (1.0 - 1e-12):  # inelastic: what moves rigidly stops dead
        y[layout.LOST_IMPACT] += 0.5 * piston_mass(par) * y[V] ** 2
        y[X] = par.half if y[X] > 0.0 else -par.half
    y[V] = 0.0
    over = excess(t, y, par, bristles)
    if over == 0.0:
        return HELD
    if par.presliding_distance > 0.0:
        return FREE
    return UP if over > 0.0 else DOWN


@kernel
def advance(
    t: float, h: float, y: FloatArray, par: Any, mode: int, target: FloatArray,
    bristles: FloatArray, work: FloatArray,
) -> Any:  # fmt: skip
    """Move the state by h [s], through all events on the way, and return the mode at the end."""
    after = work[3]
    low, high, tried, events = 0.0, 1.0, 1.0, 0
    while True:  # trial and bisection share one call, as above
        runge_kutta(t, tried * h, y, after, work, par, mode, target, bristles)
        left = events < MOST_EVENTS and margin(t + tried * h, after, par, mode, bristles) < 0.0
        if tried == 1.0 and not left:
            break
        if high - low > INSTANT or tried < high:
            low, high = (low, tried) if left else (tried, high)
            # In the end just past the event: what breaks loose there exceeds what holds.
            tried = (low + high) / 2.0 if high - low > INSTANT else high
            continue
        copy(after, y)
        t, h = t + high * h, (1.0 - high) * h
        if par.presliding_distance > 0.0:
            write_bristles(y[X], bristles, par)
        mode = switched(t, y, par, mode, bristles)
        low, high, tried, events = 0.0, 1.0, 1.0, events + 1
    copy(after, y)
    if par.presliding_distance > 0.0:
        write_bristles(y[X], bristles, par)
    return mode
