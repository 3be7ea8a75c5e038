"""The valve: from the held command to the spool, and through its two edges."""

from math import exp, sqrt, tanh
from typing import Any

from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.virtual_bench.kernels.gas import restriction
from pneumo_casadi.virtual_bench.kernels.jit import entry, kernel
from pneumo_casadi.virtual_bench.kernels.layout import SPOOL_N, SPOOL_P

#: Greatest critical ratio of an edge.
CRITICAL_MOST = 0.9
#: Half-widths of the plays of which the hysteresis is made, in half-widths of its loop, and
#: their weights (Prandtl-Ishlinskii); what is left of the weight follows at once.
PLAYS = (0.35, 0.8, 1.5)
WEIGHTS = (0.2, 0.4, 0.3)


@kernel
def conductance(
    k: float, s: float, lap: float, leak: float, notch: float, notch_s: float, par: Any
) -> Any:
    """Return the sonic conductance of one edge [m³/(s Pa)] at the spool position s [V].

    Open, the flow passes the radial clearance and the opening at right angles, so that they add
    as squares; closed, the clearance lengthens and its conductance falls off as 1/(c + κ|s|)
    (Eryilmaz and Wilson 2006).
    """
    z, c = s - lap, par.clearance
    if z < 0.0:
        return leak + k * c * c / (c - par.closing * z)
    opening = sqrt(z * z + c * c)
    if notch != 0.0:  # notches in the edge: less gain at small openings
        opening *= 1.0 - notch * (z / notch_s) * exp(1.0 - z / notch_s)
    return leak + k * opening


@kernel
def valve_flows(
    par: Any,
    s: float,
    p: float,
    T: float,
    p_supply: float,
    p_exhaust: float,
    gain: float,
    b_more: float,
) -> Any:
    """Return the flows supply to outlet and outlet to exhaust [kg/s]; gain scales the supply edge.

    A valve of other gain differs less at its exhaust edge: by 0.8 of the difference. Its critical
    ratio is greater than on the metering bench by `b_more` at the supply edge, by 0.6 of it at the
    exhaust edge.
    """
    notch, notch_s = par.flow_map_shape_notch, par.flow_map_shape_opening
    C_s = conductance(par.k_supply, s, par.lap_supply, par.leak_supply, notch, notch_s, par)
    C_e = conductance(par.k_exhaust, -s, par.lap_exhaust, par.leak_exhaust, notch, notch_s, par)
    C_s *= gain
    C_e *= 1.0 + 0.8 * (gain - 1.0)
    b_s = min(par.b_supply + b_more, CRITICAL_MOST)
    b_e = min(par.b_exhaust + 0.6 * b_more, CRITICAL_MOST)
    inlet = restriction(C_s, b_s, par.m_supply, p_supply, par.T, p, T)
    outlet = restriction(C_e, b_e, par.m_exhaust, p, T, p_exhaust, par.T)
    return inlet, outlet


@entry
def meter(par: Any, u: FloatArray, p: FloatArray, gain: float, q: FloatArray) -> None:
    """Fill q [kg/s] with the static flow into a vessel at commands u [V] and pressures p [Pa]."""
    for i in range(u.size):
        inlet, outlet = valve_flows(par, u[i], p[i], par.T, par.p_supply, par.p_ext, gain, 0.0)
        q[i] = inlet - outlet


@kernel
def spool_targets(t: float, u: FloatArray, plays: FloatArray, target: FloatArray, par: Any) -> None:
    """Fill the spool positions [V] that the held commands u (2,) ask for; move the plays (2, 3)."""
    for valve in range(2):
        s = u[valve]
        width = par.valve_hysteresis_width * (par.valve_hysteresis_at_N if valve else 1.0)
        if width > 0.0 and par.valve_hysteresis_law == 1.0:
            s = min(max(plays[valve, 0], u[valve] - width / 2.0), u[valve] + width / 2.0)
            plays[valve, 0] = s
        elif width > 0.0 and par.valve_hysteresis_law == 2.0:
            if abs(u[valve] - plays[valve, 0]) > width / 2.0:
                plays[valve, 0] = u[valve]
            s = plays[valve, 0]
        elif width > 0.0:
            s = 0.0
            follows = 1.0
            for i in range(3):
                radius = PLAYS[i] * width / 2.0
                at = min(max(plays[valve, i], u[valve] - radius), u[valve] + radius)
                plays[valve, i] = at
                s += WEIGHTS[i] * at
                follows -= WEIGHTS[i]
            s += follows * u[valve]
        if par.valve_dead_zone_width > 0.0:
            half = par.valve_dead_zone_width / 2.0 * (par.valve_dead_zone_at_N if valve else 1.0)
            if par.valve_dead_zone_smooth > 0.0 and half > 0.0:
                s -= half * tanh(s / half)
            else:
                below, above = par.valve_dead_zone_below * half, par.valve_dead_zone_above * half
                if valve and par.valve_dead_zone_turned > 0.0:
                    below, above = above, below
                s -= min(max(s, -below), above)
        warming = 1.0 - 0.15 * exp(-max(t, 0.0) / 5.0)  # the offset settles as the coil warms
        s += (par.valve_null_shift_P if valve == 0 else par.valve_null_shift_N) * warming
        target[valve] = s


@kernel
def spool_rates(at: int, target: float, y: FloatArray, dy: FloatArray, par: Any) -> Any:
    """Fill the rates of one spool: coil, then mass on spring with limited speed; return s [V]."""
    omega = par.valve_dynamics_omega
    if omega <= 0.0:
        return target
    coil, s, speed = y[at], y[at + 1], y[at + 2]
    if par.valve_dynamics_first_order > 0.0:
        faster = par.valve_dynamics_at_N if at == SPOOL_N else 1.0
        dy[at + 1] = (target - s) * omega / (1.4 * faster)
        return s
    limit = par.valve_dynamics_rate
    dy[at] = (target - coil) * omega / 0.2
    dy[at + 1] = min(max(speed, -limit), limit)
    dy[at + 2] = omega * omega * (coil - s) - 2.0 * par.valve_dynamics_zeta * omega * speed
    return s


@kernel
def spools(target: FloatArray, y: FloatArray, dy: FloatArray, par: Any) -> Any:
    """Return both spool positions [V] and fill their rates."""
    s_P = spool_rates(SPOOL_P, target[0], y, dy, par)
    s_N = spool_rates(SPOOL_N, target[1], y, dy, par)
    return s_P, s_N
