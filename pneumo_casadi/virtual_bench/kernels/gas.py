"""Gas: the flow through one restriction and the balances of a chamber."""

from math import pi, sqrt, tanh
from typing import Any

from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.virtual_bench.kernels.jit import kernel
from pneumo_casadi.virtual_bench.kernels.layout import (
    GAS_N,
    GAS_P,
    MASS_N,
    MASS_P,
    WALL_N,
    WALL_P,
    X,
)

#: Standard reference atmosphere, ISO 8778 [kg/m³, K].
RHO_0, T_0 = 1.185, 293.15
#: Pressure ratio above which the flow is laminar, straight in the ratio (ISO 6358-1:2013, 3.1).
LAMINAR = 0.999
#: Ratio of specific heats of air [1].
GAMMA = 1.4
#: Critical pressure ratio and subsonic index of a leak that is a hole.
B_LEAK, M_LEAK = 0.35, 0.5
#: Length over which a seal comes onto a score of the tube [m].
SEAL = 4e-3
#: Time in which walls give their heat to their surroundings [s].
TAU_WALL = 30.0


@kernel
def restriction(
    C: float, b: float, m: float, p_1: float, T_1: float, p_2: float, T_2: float
) -> Any:
    """Return the mass flow [kg/s] from side 1 to side 2 after ISO 6358."""
    if p_1 >= p_2:
        return C * p_1 * RHO_0 * sqrt(T_0 / T_1) * _subsonic(p_2 / p_1, b, m)
    return -C * p_2 * RHO_0 * sqrt(T_0 / T_2) * _subsonic(p_1 / p_2, b, m)


@kernel
def _subsonic(ratio: float, b: float, m: float) -> Any:
    if ratio <= b:
        return 1.0
    if ratio > LAMINAR:
        edge = (LAMINAR - b) / (1.0 - b)
        return (1.0 - edge * edge) ** m * (1.0 - ratio) / (1.0 - LAMINAR)
    excess = (ratio - b) / (1.0 - b)
    return (1.0 - excess * excess) ** m


@kernel
def volumes(y: FloatArray, par: Any) -> Any:
    """Return the volumes of the chambers [m³] (P, N)."""
    return par.V_P0 + par.S_P * y[X], par.V_N0 - par.S_N * y[X]


@kernel
def gas_states(y: FloatArray, par: Any) -> Any:
    """Return pressure [Pa] and temperature [K] of the chambers (p_P, T_P, p_N, T_N)."""
    if par.heat_transfer_tau <= 0.0:
        return y[GAS_P], par.T, y[GAS_N], par.T
    V_P, V_N = volumes(y, par)
    p_P, p_N = (GAMMA - 1.0) * y[GAS_P] / V_P, (GAMMA - 1.0) * y[GAS_N] / V_N
    return p_P, p_P * V_P / (y[MASS_P] * par.r), p_N, p_N * V_N / (y[MASS_N] * par.r)


@kernel
def enthalpy(q: float, T_outside: float, T_inside: float, par: Any) -> Any:
    """Return what a flow q into the chamber [kg/s] brings of enthalpy [W]; out it takes its own."""
    c_p = GAMMA * par.r / (GAMMA - 1.0)
    return c_p * q * (T_outside if q > 0.0 else T_inside)


@kernel
def wall_heat(
    p: float, T: float, T_wall: float, S: float, V_0: float, V_now: float, v: float, par: Any
) -> Any:
    """Return the heat from the walls [W]: conductance in proportion to the wetted area.

    At mid-stroke and 0.6 of the supply pressure the gas follows the wall with the time constant
    ``heat_transfer_tau`` at constant volume; the film grows with the square root of the pressure,
    and in its forced form with the speed of the piston.
    """
    c_v = par.r / (GAMMA - 1.0)
    p_0 = 0.6 * par.p_supply
    at_middle = p_0 * V_0 / (par.r * par.T) * c_v / par.heat_transfer_tau
    around = 2.0 * sqrt(pi / S)  # wall area per volume of a cylinder
    area = (2.0 * S + around * V_now) / (2.0 * S + around * V_0)
    stirred = 1.0
    if par.heat_transfer_forced > 0.0:
        stirred += par.heat_transfer_forced * (abs(v) / 0.1) ** 0.75
    return at_middle * area * sqrt(max(p, 0.0) / p_0) * stirred * (T_wall - T)


@kernel
def chamber_rates(
    y: FloatArray, dy: FloatArray, par: Any, q_P: float, q_N: float, H_P: float, H_N: float
) -> Any:
    """Fill the rates of both chambers for net flows [kg/s] and enthalpy flows [W].

    Returns the heat that comes in from the walls [W].
    """
    p_P, T_P, p_N, T_N = gas_states(y, par)
    V_P, V_N = volumes(y, par)
    dV_P, dV_N = par.S_P * dy[X], -par.S_N * dy[X]
    if par.heat_transfer_tau <= 0.0:
        rT = par.r * par.T
        dy[GAS_P] = par.k_P / V_P * (rT * q_P - p_P * dV_P)
        dy[GAS_N] = par.k_N / V_N * (rT * q_N - p_N * dV_N)
        return 0.0
    heat_P = wall_heat(p_P, T_P, par.T + y[WALL_P], par.S_P, par.V_P0, V_P, dy[X], par)
    heat_N = wall_heat(p_N, T_N, par.T + y[WALL_N], par.S_N, par.V_N0, V_N, dy[X], par)
    if par.heat_transfer_wall > 0.0:
        dy[WALL_P] = -heat_P / par.heat_transfer_wall - y[WALL_P] / TAU_WALL
        dy[WALL_N] = -heat_N / par.heat_transfer_wall - y[WALL_N] / TAU_WALL
    dy[GAS_P] = H_P + heat_P - p_P * dV_P
    dy[GAS_N] = H_N + heat_N - p_N * dV_N
    dy[MASS_P], dy[MASS_N] = q_P, q_N
    return heat_P + heat_N


@kernel
def seal_leakage(x: float, p_P: float, p_N: float, par: Any) -> Any:
    """Return the flow past the piston seal, P to N [kg/s]: viscous and inertial (Forchheimer).

    a q + b q|q| = p_P² − p_N², both terms equal where supply stands against ambient. A scored tube
    leaks where the piston passes the score.
    """
    scored, half = 1.0, par.piston_seal_leakage_half
    if half > 0.0:
        away = x - par.piston_seal_leakage_centre
        scored = (tanh((away + half) / SEAL) - tanh((away - half) / SEAL)) / 2.0
    full = par.p_supply**2 - par.p_ext**2
    if par.piston_seal_leakage_orifice > 0.0:
        C = par.piston_seal_leakage_q / (par.p_supply * RHO_0)
        return scored * restriction(C, B_LEAK, M_LEAK, p_P, par.T, p_N, par.T)
    z = (p_P * p_P - p_N * p_N) / full
    q = scored * par.piston_seal_leakage_q * (sqrt(1.0 + 8.0 * abs(z)) - 1.0) / 2.0
    return q if z > 0.0 else -q


@kernel
def gland_leakage(q_at_supply: float, orifice: float, p: float, par: Any) -> Any:
    """Return the viscous, compressible flow through a narrow gap to ambient [kg/s].

    It goes with the difference of the squared pressures (Poiseuille flow of a perfect gas).
    """
    if orifice > 0.0:
        C = q_at_supply / (par.p_supply * RHO_0)
        return restriction(C, B_LEAK, M_LEAK, p, par.T, par.p_ext, par.T)
    full = par.p_supply**2 - par.p_ext**2
    return q_at_supply * (p * p - par.p_ext**2) / full
