"""Forces on the piston, set-valued Coulomb friction and bristles."""

from math import cos, exp, inf, pi, sin, sinh, sqrt, tanh
from typing import Any

from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.virtual_bench.kernels.jit import kernel
from pneumo_casadi.virtual_bench.kernels.layout import (
    BRISTLES,
    FILM,
    FREE,
    V_2,
    V_3,
    X_2,
    X_3,
    V,
    X,
)

#: [m/s²].
STANDARD_GRAVITY = 9.80665
#: Slip distances of the bristles, in their mean.
SPREAD = (0.4, 0.8, 1.2, 1.6)
#: Damping ratio of the piston on unyielding bristles, and velocity at which it fades [m/s]; their
#: joint stiffness in levels per mean slip distance.
DAMPING, FADING, STIFFNESS = 0.3, 2e-3, 1.302


@kernel
def load_acceleration(y: FloatArray, par: Any) -> Any:
    """Return the acceleration that spring and damper give to the second mass [m/s²]."""
    omega, stretch = 2.0 * pi * par.elastic_load_f, y[X_2] - y[X]
    if par.elastic_load_hardening > 0.0:
        stretch = sinh(par.elastic_load_hardening * stretch) / par.elastic_load_hardening
    return -omega * (omega * stretch + 2.0 * par.elastic_load_zeta * (y[V_2] - y[V]))


@kernel
def pushed_acceleration(y: FloatArray, par: Any) -> Any:
    """Return the acceleration of the mass beyond a play, which the piston pushes only [m/s²]."""
    omega, half = 2.0 * pi * par.coupling_f, par.coupling_gap / 2.0
    apart, damped = y[X] - y[X_3], 2.0 * par.coupling_zeta * omega * (y[V] - y[V_3])
    if apart > half:
        return max(omega**2 * (apart - half) + damped, 0.0)
    if apart < -half:
        return min(omega**2 * (apart + half) + damped, 0.0)
    return 0.0


@kernel
def applied_force(t: float, y: FloatArray, p_P: float, p_N: float, par: Any) -> Any:
    """Return all force on the piston but Coulomb friction [N], and its part from gas pressure."""
    x, v = y[X], y[V]
    gas = par.S_P * p_P - par.S_N * p_N - (par.S_P - par.S_N) * par.p_ext
    F = gas - par.f_v * v + par.constant_force_F_0
    if par.slope != 0.0:  # of the way up: weight against +x
        F -= par.M * STANDARD_GRAVITY * par.slope
    if par.quadratic_drag_c > 0.0:
        c = par.quadratic_drag_c * (1.0 if v > 0.0 else par.quadratic_drag_backward)
        F -= c * abs(v) ** par.quadratic_drag_power * v
    if par.spring_load_k != 0.0:  # stiffens towards the ends
        if par.spring_load_one_sided > 0.0:  # slack at first
            F -= par.spring_load_k * par.spring_load_one_sided * max(x + 0.05 * par.half, 0.0)
        else:
            F -= par.spring_load_k * x * (1.0 + par.spring_load_hardening * (x / par.half) ** 2)
    if par.elastic_load_m_2 > 0.0:
        F -= par.elastic_load_m_2 * load_acceleration(y, par)
    if par.coupling_m_2 > 0.0:
        F -= par.coupling_m_2 * pushed_acceleration(y, par)
    if par.cogging_A > 0.0:
        F += par.cogging_A * sin(2.0 * pi * x / par.cogging_pitch)
    if par.vibration_A > 0.0:
        F += par.vibration_A * sin(2.0 * pi * par.vibration_f * t)
    if par.magnetic_latch_A > 0.0:
        F += par.magnetic_latch_A * exp((x - par.half) / par.magnetic_latch_reach)
    return F, gas


@kernel
def piston_mass(par: Any) -> Any:
    """Return the mass that moves rigidly with the piston [kg]: a tenth of all at least."""
    return max(par.M - par.elastic_load_m_2 - par.coupling_m_2, 0.1 * par.M)


@kernel
def load_rates(y: FloatArray, dy: FloatArray, par: Any) -> None:
    """Fill the rates of the masses beyond a spring and beyond a play."""
    if par.coupling_m_2 > 0.0:
        dy[X_3] = y[V_3]
        dy[V_3] = pushed_acceleration(y, par)
    if par.elastic_load_m_2 > 0.0:
        dy[X_2] = y[V_2]
        dy[V_2] = load_acceleration(y, par)


@kernel
def film_rates(y: FloatArray, dy: FloatArray, par: Any) -> None:
    """Fill the rate of the film: behind the one of steady motion, which grows as |v|^(2/3)."""
    if par.stribeck_tau > 0.0:
        steady = (abs(y[V]) / par.stribeck_v_s) ** (2.0 / 3.0)
        dy[FILM] = (steady - y[FILM]) / par.stribeck_tau


@kernel
def friction_levels(t: float, y: FloatArray, p_P: float, p_N: float, par: Any) -> Any:
    """Return the Coulomb friction against motion up and down [N], neither negative."""
    more = 0.0
    if par.stribeck_delta_F > 0.0:
        if par.stribeck_tau > 0.0:
            more += par.stribeck_delta_F * exp(-y[FILM])
        elif par.stribeck_rational > 0.0:
            more += par.stribeck_delta_F / (1.0 + (y[V] / par.stribeck_v_s) ** 2)
        else:
            decay = (abs(y[V]) / par.stribeck_v_s) ** par.stribeck_exponent
            more += par.stribeck_delta_F * exp(-decay)
    if par.pressure_friction_F > 0.0:  # lip seals: the pressure behind each lip presses it on
        full = 2.0 * (par.p_supply - par.p_ext)
        share = (max(p_P + p_N - 2.0 * par.p_ext, 0.0) / full) ** 0.9
        if par.pressure_friction_seal == 1.0:
            share = 2.0 * max(p_N - par.p_ext, 0.0) / full
        elif par.pressure_friction_seal == 2.0:
            share = 2.0 * abs(p_P - p_N) / full
        more += par.pressure_friction_F * share
    more += par.position_friction_slope * y[X]
    if par.position_friction_height != 0.0:  # a raised cosine where the catalogue has a Gaussian
        away = abs(y[X] - par.position_friction_centre) / (2.0 * par.position_friction_width)
        if away < 1.0:
            more += par.position_friction_height * (1.0 + cos(pi * away)) / 2.0
    if par.position_friction_vee_k > 0.0:
        more += par.position_friction_vee_k * abs(y[X] - par.position_friction_vee_centre)
    if par.position_friction_step_height > 0.0:
        beyond = (y[X] - par.position_friction_step_centre) / par.position_friction_step_width
        more += par.position_friction_step_height * (1.0 + tanh(beyond)) / 2.0
    if par.square_root_friction_A > 0.0:
        more += par.square_root_friction_A * sqrt(abs(y[V]))
    if par.friction_fade_delta_F > 0.0:
        more += par.friction_fade_delta_F * exp(-max(t, 0.0) / par.friction_fade_tau)
    return max(par.F_c_plus + more, 0.0), max(par.F_c_minus + more, 0.0)


@kernel
def dahl_share(moved: float, before: float, par: Any) -> Any:
    """Return the friction of Dahl's law as a share of its level after a way without reversal."""
    limit = 1.0 if moved > 0.0 else -1.0
    return limit - (limit - before) * exp(-abs(moved) / par.presliding_distance)


@kernel
def bristle_share(x: float, bristles: FloatArray, par: Any) -> Any:
    """Return the friction as a share of its level, between -1 and 1.

    Elasto-plastic elements in parallel (Iwan 1966); exact for motion without reversal since the
    deflections were last written.
    """
    moved = x - bristles[BRISTLES]
    if par.presliding_dahl > 0.0:
        return dahl_share(moved, bristles[0], par)
    share = 0.0
    for i in range(BRISTLES):
        slip = SPREAD[i] * par.presliding_distance
        share += min(max(bristles[i] + moved, -slip), slip) / (slip * BRISTLES)
    return share


@kernel
def write_bristles(x: float, bristles: FloatArray, par: Any) -> None:
    """Move the deflections to the position x [m]."""
    moved = x - bristles[BRISTLES]
    if par.presliding_dahl > 0.0:
        bristles[0] = dahl_share(moved, bristles[0], par)
    else:
        for i in range(BRISTLES):
            slip = SPREAD[i] * par.presliding_distance
            bristles[i] = min(max(bristles[i] + moved, -slip), slip)
    bristles[BRISTLES] = x


@kernel
def friction(
    mode: int, up: float, down: float, y: FloatArray, bristles: FloatArray, par: Any
) -> Any:
    """Return the friction force on the moving piston [N], positive against motion up."""
    if mode != FREE:
        return up if mode > 0 else -down
    level, v = (up + down) / 2.0, y[V]
    bent = bristle_share(y[X], bristles, par) * level + (up - down) / 2.0
    stiffness = STIFFNESS * level / par.presliding_distance
    damping = 2.0 * DAMPING * sqrt(stiffness * piston_mass(par))
    return bent + damping * v * exp(-((v / FADING) ** 2))


@kernel
def holding_limits(
    t: float, y: FloatArray, p_P: float, p_N: float, bristles: FloatArray, par: Any
) -> Any:
    """Return the forces up and down that the piston at rest withstands [N]; end stops all."""
    up, down = friction_levels(t, y, p_P, p_N, par)
    if par.presliding_distance > 0.0:  # only the stops hold: bristles give way at once
        drag = friction(FREE, up, down, y, bristles, par)
        up, down = drag, -drag
    if y[X] >= par.half:
        up = inf
    if y[X] <= -par.half:
        down = inf
    return up, down
