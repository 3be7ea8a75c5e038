"""Control laws: proportional, PID, and a velocity loop within a position loop."""

from typing import Any

from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.virtual_bench.kernels.jit import kernel

#: Kinds of law and of anti-windup, as ``par.law`` and ``par.windup`` hold them.
PROPORTIONAL, PID, CASCADE = 0, 1, 2
GOES_ON, CLAMPED, TRACKED = 0, 1, 2
#: Slots of a controller's memory: integral [V], filtered rate, value before it was differentiated,
#: command that is held [V], samples since it was computed, and whether there was one.
INTEGRAL, RATE, BEFORE, KEPT, SINCE, BEGUN = 0, 1, 2, 3, 4, 5
#: Size of this memory.
REMEMBERED = 6


@kernel
def feedback(x_ref: float, x: float, period: float, par: Any, memory: FloatArray) -> Any:
    """Return what the law adds to the null voltage at one of its samples [V]."""
    if par.law == PROPORTIONAL:
        return par.gain * (x_ref - x)
    error = x_ref - x
    measured = error if par.law == PID else x
    if memory[BEGUN] == 0.0:  # switched on at rest
        memory[BEFORE], memory[BEGUN] = measured, 1.0
    share = period / (par.law_filter + period)
    difference = (measured - memory[BEFORE]) / period
    memory[RATE] += share * (difference - memory[RATE])
    memory[BEFORE] = measured
    if par.law == PID:
        u = par.law_k_p * error + par.law_k_d * memory[RATE]
    else:
        wanted = min(max(par.law_k_p * error, -par.law_v_max), par.law_v_max)
        error = wanted - memory[RATE]
        u = par.law_k_v * error
    more = par.law_k_i * period * error
    u += memory[INTEGRAL] + more
    limited = min(max(u, par.law_u_min), par.law_u_max)
    outwards = (u - limited) * more > 0.0
    if not (par.windup == CLAMPED and outwards):
        memory[INTEGRAL] += more
    if par.windup == TRACKED:
        memory[INTEGRAL] += (limited - u) * period / par.law_tracking
    return limited


@kernel
def held_feedback(x_ref: float, x: float, dt: float, par: Any, memory: FloatArray) -> Any:
    """Return the command [V] at a sample of the record, computed at every n-th of them."""
    if memory[SINCE] == 0.0:
        memory[KEPT] = feedback(x_ref, x, par.law_samples * dt, par, memory)
    memory[SINCE] = (memory[SINCE] + 1.0) % par.law_samples
    return memory[KEPT]
