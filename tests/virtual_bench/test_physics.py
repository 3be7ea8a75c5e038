"""The bench's own physics: balances, rest, end stops, forces, limits of gas and valve."""

from dataclasses import replace

import numba
import numpy as np
import pytest

from pneumo_casadi.virtual_bench import Excitation, effects_for, metered_map, sanity, simulate_axis
from pneumo_casadi.virtual_bench.kernels import layout
from pneumo_casadi.virtual_bench.kernels.gas import RHO_0, restriction
from pneumo_casadi.virtual_bench.sanity import energy_error


@pytest.fixture(scope="module")
def found():
    return sanity(seed=5, duration=2.0)


@pytest.mark.slow
def test_mass_is_conserved_through_valves_lines_and_leaks(found):
    assert found.mass_error < 1e-12


def test_energy_is_conserved_with_heat_friction_and_motion(found):
    assert found.energy_error < 1e-11


def test_halving_the_step_reduces_the_error_by_third_order_across_events(found):
    assert found.order > 2.5
    assert found.step_errors[-1] < 1e-9


def test_a_piston_held_by_friction_does_not_move_at_all(found):
    assert found.held_drift == 0.0


def test_a_piston_driven_against_its_stops_never_goes_beyond_them(found):
    assert found.stop_excess == 0.0


def test_energy_lost_in_an_end_stop_is_counted(axis):
    loose = replace(axis, F_c_plus=1.0, F_c_minus=1.0, f_v=0.0).with_ideal_sensors()
    reference = np.where(np.arange(2000) < 1000, 1.0, -1.0) * axis.stroke
    hidden = effects_for(loose, {"heat_transfer": "medium"})
    run = simulate_axis(loose, Excitation(reference, np.zeros(2000)), hidden)
    assert run.states[-1, layout.LOST_IMPACT] > 0.1
    assert energy_error(loose, run) < 1e-10


def test_the_energy_balance_sees_energy_that_is_missing(axis, drive):
    hidden = effects_for(axis, {"heat_transfer": "medium"})
    run = simulate_axis(axis, drive, hidden)
    assert energy_error(axis, run) < 1e-11
    assert energy_error(replace(axis, M=1.01 * axis.M), run) > 1e-6


def test_at_rest_velocity_is_zero_and_position_constant_while_pressures_change(axis, drive):
    states, modes = (found := simulate_axis(axis, drive)).states, found.modes
    held = (modes[:-1] == layout.HELD) & (modes[1:] == layout.HELD)
    still = held & (np.diff(states[:, layout.LOST_WORK]) == 0)
    assert still.sum() > 50
    assert (states[modes == layout.HELD, layout.V] == 0).all()
    assert (np.diff(states[:, layout.X])[still] == 0).all()
    assert (np.diff(states[:, layout.GAS_P])[still] != 0).any()


def test_sliding_obeys_newton_with_the_friction_of_its_direction(axis, drive):
    y = simulate_axis(axis.with_ideal_sensors(), drive).states
    v = y[:, layout.V]
    sliding = (np.abs(v[:-2]) > 1e-2) & (np.abs(v[2:]) > 1e-2) & (v[:-2] * v[2:] > 0)
    gas = axis.S_P * y[:, layout.GAS_P] - axis.S_N * y[:, layout.GAS_N]
    F_c = np.where(v > 0, axis.F_c_plus, -axis.F_c_minus)
    force = gas - (axis.S_P - axis.S_N) * axis.p_ext - axis.f_v * v - F_c
    a = (v[2:] - v[:-2]) / 2e-3
    np.testing.assert_allclose(axis.M * a[sliding], force[1:-1][sliding], atol=0.3)
    assert sliding.sum() > 200


def test_a_restriction_chokes_and_is_antisymmetric():
    flow = numba.njit(lambda p_1, p_2: restriction(2e-8, 0.3, 0.5, p_1, 293.15, p_2, 293.15))
    q = [flow(7e5, p) for p in (1e5, 2.1e5, 5e5, 7e5)]
    assert q[0] == q[1] == pytest.approx(2e-8 * 7e5 * RHO_0)
    assert q[1] > q[2] > q[3] == 0.0
    assert flow(5e5, 7e5) == -q[2]


def test_heat_exchange_runs_from_isothermal_to_adiabatic(axis, drive):
    """At constant friction lock the piston compresses nothing: temperature answers the valves."""

    def swing(tau: float) -> float:
        hidden = effects_for(axis, {"heat_transfer": {"tau": tau}})
        y = simulate_axis(axis, drive, hidden).states
        volume = axis.V_P0 + axis.S_P * y[:, layout.X]
        p = 0.4 * y[:, layout.GAS_P] / volume
        return float(np.abs(p * volume / (y[:, layout.MASS_P] * axis.r) - axis.T).max())

    fast, medium, slow = (swing(tau) for tau in (1e-3, 0.08, 30.0))
    assert fast < 0.5 < 3.0 < medium < slow


def test_the_valve_is_metered_without_the_effect_unless_it_is_its_shape(axis):
    def flow(effects) -> np.ndarray:
        return metered_map(axis, effects_for(axis, effects), seed=1)["q_m_kg_per_s"]

    nominal = flow({})
    hidden = flow({"leakage_P": "large", "valve_dead_zone": "large", "valve_mismatch": "large"})
    np.testing.assert_array_equal(hidden, nominal)
    assert np.abs(flow({"flow_map_shape": "small"}) - nominal).max() > 1e-4 * nominal.max()
    table = metered_map(axis, seed=1)
    u, p = table["u_V"], table["p_Pa"]
    between = (p > 1.2 * axis.p_ext) & (p < 0.9 * axis.p_supply)
    assert nominal[(u > 1) & between].min() > 3e-4
    assert nominal[(u < -1) & between].max() < -3e-4
