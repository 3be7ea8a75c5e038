"""What lies around the valves: supply reservoir, silencer, lines to the chambers."""

from math import pi, sin
from typing import Any

from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.virtual_bench.kernels.gas import restriction
from pneumo_casadi.virtual_bench.kernels.jit import kernel
from pneumo_casadi.virtual_bench.kernels.layout import (
    CELLS,
    LINE_N,
    P_EXHAUST,
    P_SUPPLY,
    Q_REGULATOR,
)

#: Volume before the silencer [m³] and time constant of the regulator's diaphragm [s].
V_SILENCER, TAU_REGULATOR = 5e-5, 0.02
#: Friction factor of a smooth hose (Darcy) and kinematic viscosity of air at 1 bar [m²/s].
DARCY, NU = 0.03, 1.5e-5
#: Critical pressure ratio and subsonic index of hose fittings (ISO 6358).
B_FITTINGS, M_FITTINGS = 0.38, 0.52


@kernel
def port_pressures(t: float, y: FloatArray, par: Any) -> Any:
    """Return the pressures at the supply and exhaust ports of the valves [Pa]."""
    p_supply = y[P_SUPPLY] if par.supply_droop_volume > 0.0 else par.p_supply
    if par.supply_pulsation_share > 0.0:
        p_supply *= 1.0 + par.supply_pulsation_share * sin(2.0 * pi * par.supply_pulsation_f * t)
    p_exhaust = y[P_EXHAUST] if par.exhaust_restriction_C > 0.0 else par.p_ext
    return p_supply, p_exhaust


@kernel
def port_rates(y: FloatArray, dy: FloatArray, par: Any, q_in: float, q_out: float) -> Any:
    """Fill the rates of reservoir and silencer for all flow in and out of the valves [kg/s].

    The reservoir is isothermal and filled by a regulator whose flow follows the pressure drop
    with a lag, and never flows back; the silencer is turbulent.
    """
    rT = par.r * par.T
    if par.supply_droop_volume > 0.0:
        dy[P_SUPPLY] = rT / par.supply_droop_volume * (y[Q_REGULATOR] - q_in)
        demand = max(par.supply_droop_G * (par.p_supply - y[P_SUPPLY]), 0.0)
        dy[Q_REGULATOR] = (demand - y[Q_REGULATOR]) / TAU_REGULATOR
    if par.exhaust_restriction_C > 0.0:
        away = restriction(
            par.exhaust_restriction_C, 0.3, 0.5, y[P_EXHAUST], par.T, par.p_ext, par.T
        )
        dy[P_EXHAUST] = rT / V_SILENCER * (q_out - away)


@kernel
def line_rates(
    at: int, q_valve: float, p_chamber: float, T_chamber: float, y: FloatArray, dy: FloatArray,
    par: Any,
) -> Any:  # fmt: skip
    """Fill the rates of one line, pressures and flows in turns, and return its end flow [kg/s].

    Isothermal gas with inertia between cells: waves at √(rT), laminar and turbulent wall friction.
    """
    rT = par.r * par.T
    if par.hose_volume_V > 0.0:  # one volume behind fittings
        q = restriction(
            par.hose_volume_C, B_FITTINGS, M_FITTINGS, y[at], par.T, p_chamber, T_chamber
        )
        V = par.hose_volume_V * (par.hose_volume_at_N if at == LINE_N else 1.0)
        dy[at] = rT / V * (q_valve - q)
        return q
    length, d = par.hose_length / CELLS, par.hose_diameter
    if at == LINE_N:
        length *= par.hose_at_N
    area = pi * d * d / 4.0
    into = q_valve
    for i in range(CELLS):
        p, q = y[at + i], y[at + CELLS + i]
        after = y[at + i + 1] if i + 1 < CELLS else p_chamber
        rho = max(p + after, 2e3) / (2.0 * rT)
        speed = abs(q) / (rho * area)
        nu = NU * 1.185 / rho
        friction = 32.0 * nu / (d * d) + DARCY * speed / (2.0 * d)
        dy[at + i] = rT / (area * length) * (into - q)
        dy[at + CELLS + i] = area / length * (p - after) - friction * q
        into = q
    return into
