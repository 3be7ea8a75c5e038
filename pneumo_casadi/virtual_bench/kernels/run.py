"""The loop of samples: sense, control, hold, integrate."""

from math import isfinite
from typing import Any

import numpy as np

from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.virtual_bench.kernels.control import REMEMBERED, held_feedback
from pneumo_casadi.virtual_bench.kernels.gas import GAMMA, volumes
from pneumo_casadi.virtual_bench.kernels.jit import entry, kernel
from pneumo_casadi.virtual_bench.kernels.layout import (
    BRISTLES,
    CELLS,
    FREE,
    GAS_N,
    GAS_P,
    HELD,
    LINE_N,
    LINE_P,
    MASS_N,
    MASS_P,
    P_EXHAUST,
    P_SUPPLY,
    SIZE,
    TAP_N,
    TAP_P,
    X_2,
    X_3,
    V,
    X,
)
from pneumo_casadi.virtual_bench.kernels.sensors import MEMORY, observe, quantised, settle
from pneumo_casadi.virtual_bench.kernels.step import advance, copy, rates
from pneumo_casadi.virtual_bench.kernels.valve import spool_targets


@kernel
def initial_state(x: float, p_P: float, p_N: float, par: Any) -> Any:
    """Return the state (SIZE,) at rest at x [m] with the chambers at p_P and p_N [Pa]."""
    y = np.zeros(SIZE)
    y[X], y[X_2], y[X_3] = x, x, x
    y[GAS_P], y[GAS_N] = p_P, p_N
    if par.heat_transfer_tau > 0.0:
        V_P, V_N = volumes(y, par)
        y[GAS_P], y[GAS_N] = p_P * V_P / (GAMMA - 1.0), p_N * V_N / (GAMMA - 1.0)
        y[MASS_P], y[MASS_N] = p_P * V_P / (par.r * par.T), p_N * V_N / (par.r * par.T)
    y[P_SUPPLY], y[P_EXHAUST] = par.p_supply, par.p_ext
    y[TAP_P], y[TAP_N] = p_P, p_N
    for i in range(CELLS):
        y[LINE_P + i], y[LINE_N + i] = p_P, p_N
    return y


@kernel
def control(
    shown: FloatArray, noise: FloatArray, x_ref: float, common: float, dt: float, par: Any,
    memory: FloatArray, row: FloatArray,
) -> None:  # fmt: skip
    """Fill a row (u_P, u_N, p_P, p_N, x): sampled outputs, and the commands."""
    row[2] = quantised(shown[0] + noise[0], par.p_quantum)
    row[3] = quantised(shown[1] + noise[1], par.p_quantum)
    row[4] = quantised(shown[2] + noise[2], par.x_quantum)
    u = held_feedback(x_ref, row[4], dt, par, memory)
    for valve in range(2):
        wanted = (u if valve == 0 else -u) + common + par.law_u_0
        row[valve] = quantised(min(max(wanted, -par.u_max), par.u_max), par.u_quantum)


@entry
def run(
    par: Any, start: FloatArray, x_ref: FloatArray, common: FloatArray, noise: FloatArray,
    instants: FloatArray, intervals: FloatArray, dt: float, substeps: int, settling: int,
    rows: FloatArray, states: FloatArray, modes: FloatArray, accelerations: FloatArray,
) -> None:  # fmt: skip
    """Run the axis under its controller.

    `start` is (x, p_P, p_N). x_ref, common (N,) and noise (N, 3) are given for each sample, and the
    `instants` at which they are taken with the `intervals` (N,) that follow [s], about `dt`, which
    the controller takes them for; each is integrated in `substeps` steps. Before the record the
    loop runs for `settling` samples at the first reference. The function fills `rows` (N, ROW),
    and `states` (N, SIZE), `modes` and `accelerations` (N,) as far as they have rows.
    """
    h = dt / substeps
    y = initial_state(start[0], start[1], start[2], par)
    bristles, work = np.zeros(BRISTLES + 1), np.zeros((4, SIZE))
    bristles[BRISTLES] = y[X]
    past = np.zeros(int(par.position_delay_T / h) + 3)
    memory, shown, row = np.zeros(MEMORY), np.zeros(3), np.zeros(rows.shape[1])
    remembered = np.zeros(REMEMBERED)
    plays, target, quiet = np.zeros((2, 3)), np.zeros(2), np.zeros(3)
    late, done = int(par.valve_dead_time_T / h + 0.5), -1  # in steps of the integration
    sent = np.zeros((late // substeps + 2, 2))
    mode = FREE if par.presliding_distance > 0.0 else HELD
    settle(y, par, memory, past)
    now = 0
    observe(y, par, memory, past, now, h, shown)
    for k in range(-settling, x_ref.size):
        j = max(k, 0)
        t, h = (instants[k], intervals[k] / substeps) if k >= 0 else (k * dt, dt / substeps)
        observed = noise[k] if k >= 0 else quiet
        control(shown, observed, x_ref[j], common[j], dt, par, remembered, row)
        copy(row[:2], sent[(k + settling) % sent.shape[0]])
        if k >= 0:
            copy(row, rows[k])
        for i in range(substeps):
            due = (now - late) // substeps
            if due > done:  # each command once, for the plays
                spool_targets(t + i * h, sent[due % sent.shape[0]], plays, target, par)
                done = due
            if i == 0 and 0 <= k < states.shape[0]:
                copy(y, states[k])
                modes[k] = mode
                rates(t, y, work[0], par, mode, target, bristles)
                accelerations[k] = work[0, V]
            mode = advance(t + i * h, h, y, par, mode, target, bristles, work)
            now += 1
            observe(y, par, memory, past, now, h, shown)
        if not isfinite(y[V]):
            break
