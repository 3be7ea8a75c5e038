"""From rates to samples: against SciPy, against the order of the method, and by the hold."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from pneumo_casadi.data import InputHold
from pneumo_casadi.effects import Stribeck
from pneumo_casadi.model.integration import held_inputs, step_function
from pneumo_casadi.model.machine_code.compilation import generate_code
from pneumo_casadi.model.simulation import simulate, simulate_closed_loop
from pneumo_casadi.model.stepping import ACCURATE, COARSE, Stepping, substeps_for


def typed_out(axis):
    """Equations 1 to 4 in NumPy, independent of the package's balances."""
    p, bench, flow = axis.parameters.as_dict(), axis.bench, axis.flow

    def rates(x, u):
        p_P, p_N, q, v = x
        direction = np.tanh(v / p["v_s"])
        friction = p["f_v"] * v
        friction += p["F_c_plus"] * (1 + direction) / 2 - p["F_c_minus"] * (1 - direction) / 2
        effort = bench.S_P * p_P - bench.S_N * p_N - (bench.S_P - bench.S_N) * bench.p_ext
        return np.array(
            [
                (float(flow(u[0], p_P)) - p["X_s3"] * p_P * v) / (p["X_s1"] + p["X_s2"] * q),
                (float(flow(u[1], p_N)) + p["X_s6"] * p_N * v) / (p["X_s4"] - p["X_s5"] * q),
                v,
                (effort - friction) / p["M"],
            ]
        )

    return rates


@pytest.fixture(scope="module")
def smooth(made):
    """An axis of wide friction, and commands that never cross zero."""
    axis = made.true_axis().with_parameters({"v_s": 0.3})
    t = np.arange(61) * 2e-3
    u = 0.8 + 0.3 * np.sin(9 * t)
    return axis, np.column_stack([u, -u]), np.array([3.8e5, 4.4e5, -0.05, 0.1])


def exact(axis, u, x, dt, hold):
    rates, found = typed_out(axis), [x]
    for k in range(len(u) - 1):
        slope = (u[k + 1] - u[k]) / dt if hold is InputHold.LINEAR else 0.0 * u[k]
        done = solve_ivp(
            lambda t, y, k=k, slope=slope: rates(y, u[k] + slope * t),
            (0, dt),
            found[-1],
            method="DOP853",
            rtol=1e-12,
            atol=1e-12 * axis.state_scales,
        )
        found.append(done.y[:, -1])
    return np.array(found).T


def distance(axis, one, other):
    return float(np.max(np.abs(one - other) / axis.state_scales[:, None]))


def test_rates_are_those_of_eq_1_to_4_typed_out(made):
    axis, rng = made.true_axis(), np.random.default_rng(0)
    for _ in range(50):
        x, u = made.states(axis, rng)
        found = axis.rhs(x, u, axis.parameters.values).full().ravel()
        np.testing.assert_allclose(found, typed_out(axis)(x, u), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("hold", list(InputHold))
def test_samples_agree_with_dop853_to_1e_8_of_the_states_sizes(smooth, made, hold):
    axis, u, x_0 = smooth
    found = made.steps(axis, u, x_0, hold, 2e-3, substeps=2)
    wanted = exact(axis, u, x_0, 2e-3, hold)
    assert np.ptp(wanted[2]) > 0.01
    assert distance(axis, found, wanted) < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("hold", list(InputHold))
def test_the_error_falls_with_the_fourth_power_of_the_step(smooth, made, hold):
    axis, u, x_0 = smooth
    coarse = u[::10]
    wanted = exact(axis, coarse, x_0, 2e-2, hold)
    errors = [
        distance(axis, made.steps(axis, coarse, x_0, hold, 2e-2, n), wanted) for n in (1, 2, 4)
    ]
    ratios = np.array(errors[:-1]) / errors[1:]
    assert np.all((ratios > 12) & (ratios < 22)), (errors, ratios)


def test_both_holds_differ_where_the_input_moves(smooth, made):
    axis, u, x_0 = smooth
    zero, linear = (made.steps(axis, u, x_0, hold, 2e-3, 2) for hold in InputHold)
    assert distance(axis, zero, linear) > 1e-3


def test_under_zero_hold_an_input_acts_from_its_own_sample_on(made):
    axis = made.true_force_axis().with_parameters(
        {"M": 2.0, "f_v": 0.0, "F_c_plus": 0.0, "F_c_minus": 0.0}
    )
    F = np.zeros((6, 1))
    F[2] = 4.0  # a = 2 m/s² from t_2 to t_3
    x = made.steps(axis, F, [0.0, 0.0], InputHold.ZERO, 0.1, 1)
    np.testing.assert_allclose(x[1], [0, 0, 0, 0.2, 0.2, 0.2], atol=1e-14)
    np.testing.assert_allclose(x[0], [0, 0, 0, 0.01, 0.03, 0.05], atol=1e-14)


def test_under_linear_hold_an_input_is_a_ramp_between_samples(made):
    axis = made.true_force_axis().with_parameters(
        {"M": 2.0, "f_v": 0.0, "F_c_plus": 0.0, "F_c_minus": 0.0}
    )
    F = np.array([[0.0], [4.0], [0.0], [0.0]])
    x = made.steps(axis, F, [0.0, 0.0], InputHold.LINEAR, 0.1, 1)
    np.testing.assert_allclose(x[1], [0, 0.1, 0.2, 0.2], atol=1e-14)


def test_the_last_input_is_used_by_linear_hold_only(made):
    axis, u = made.true_axis(), np.arange(8.0).reshape(4, 2)
    np.testing.assert_array_equal(held_inputs(axis, u, InputHold.ZERO), u[:-1].T)
    linear = held_inputs(axis, u, InputHold.LINEAR)
    np.testing.assert_array_equal(linear, np.vstack([u[:-1].T, u[1:].T]))


@pytest.mark.slow
@pytest.mark.parametrize("v_s", [1e-2, 1e-3, 1e-4, 1e-5])
def test_sticking_under_narrow_friction_is_stable_at_the_substeps_chosen(made, v_s):
    axis = made.true_force_axis().with_parameters({"v_s": v_s})
    n = substeps_for(axis, 1e-3)
    x = made.steps(axis, np.full((200, 1), 4.0), [0.0, 2.5e-3], substeps=n)
    # Held by friction: it creeps at the speed where the smoothed friction balances 4 N.
    creep = brentq(lambda v: 25.0 * v - 2.5 + 14.5 * np.tanh(v / v_s) - 4.0, 0.0, v_s)
    assert x[1, -1] == pytest.approx(creep, rel=1e-4)


@pytest.mark.slow
def test_coarse_steps_take_half_as_many_and_change_less_than_a_hundredth_of_the_noise(made):
    """Strokes that stick and slide, 10 µm of noise: what a diagnosis simulates with."""
    axis = made.true_force_axis().with_parameters({"v_s": 3e-4})
    few, many = (substeps_for(axis, 1e-3, longest) for longest in (COARSE, ACCURATE))
    assert few <= many / 2 + 0.5
    F = 18.0 * np.sin(2 * np.pi * 2.0 * np.arange(1000) / 1e3)[:, None]
    coarse, fine = (made.steps(axis, F, [0.0, 0.0], substeps=n)[0] for n in (few, 4 * many))
    assert np.ptp(fine) > 1e-3  # it moves
    assert np.abs(coarse - fine).max() < 1e-7


@pytest.mark.slow
def test_effects_that_stiffen_the_axis_get_their_own_substeps(made):
    """Stribeck's 60 N on 14.5 N of Coulomb friction make standstill five times as stiff."""
    axis = made.true_force_axis(Stribeck()).with_parameters({"stribeck.delta_F": 60.0, "v_s": 1e-4})
    plain = made.true_force_axis().with_parameters({"v_s": 1e-4})
    assert substeps_for(axis, 1e-3) >= 4 * substeps_for(plain, 1e-3)
    F = np.full((300, 1), 4.0)
    n = substeps_for(axis, 1e-3)
    chosen = made.steps(axis, F, [0.0, 2e-3], substeps=n)[1, -1]
    # The force is held, so samples three times n as short are steps three times as fine, and
    # one short step compiles in no time.
    short = np.repeat(F, 3 * n, axis=0)
    fine = made.steps(axis, short, [0.0, 2e-3], dt=1e-3 / (3 * n), substeps=1)[1, :: 3 * n]
    assert chosen == pytest.approx(fine[-1], rel=1e-3)


@pytest.mark.slow
def test_a_lag_sampled_slowly_stays_stable(made):
    axis = made.true_axis(made.ValveLag())
    nominal = made.true_axis().with_parameters({"v_s": 1.0})
    axis = axis.with_parameters({"v_s": 1.0})
    assert substeps_for(nominal, 8e-3) == 1 and substeps_for(axis, 8e-3) == 8
    u = np.tile([0.5, -0.5], (40, 1))
    x = made.steps(axis, u, [4e5, 5e5, 0, 0, 0, 0], dt=8e-3, substeps=substeps_for(axis, 8e-3))
    np.testing.assert_allclose(x[4:, -1], [0.5, -0.5], rtol=1e-6)


def test_step_names_do_not_clash_with_the_axis(made):
    step = step_function(made.true_axis(), Stepping(1e-3))
    assert (step.name_in(0), step.name_in(1), step.name_in(2)) == ("x", "w", "theta")


def test_samples_of_their_own_lengths_are_integrated_over_these(made):
    axis = made.true_axis()
    u = 0.5 + 0.2 * np.sin(np.linspace(0, 9, 301))
    inputs = np.column_stack([u, -u])
    lengths = 1 + 0.3 * np.sin(np.arange(300) ** 2)
    x_0 = [4e5, 4.5e5, 0.0, 0.0]
    timed = simulate(axis, inputs, 1e-3, x_0, lengths=lengths)
    assert timed.t == pytest.approx(1e-3 * np.concatenate([[0], np.cumsum(lengths)]))
    # On a clock ten times as fast, held as long as each sample lasts, in whole hundredths.
    counts = np.round(100 * lengths).astype(int)
    rounded = simulate(axis, inputs, 1e-3, x_0, lengths=counts / 100)
    fine = np.repeat(inputs, np.append(counts, 1), axis=0)
    reference = simulate(axis, fine, 1e-5, x_0)
    at = np.concatenate([[0], np.cumsum(counts)])
    for name in axis.outputs:
        assert rounded[name] == pytest.approx(reference[name][at], rel=1e-4, abs=1e-8)


@pytest.mark.parametrize("hold", list(InputHold))
def test_steps_in_groups_are_the_steps_written_out(smooth, hold):
    axis, u, x = smooth
    stepping = Stepping(4e-3, hold, substeps=12)
    w = held_inputs(axis, u[:2], hold)[:, 0]
    called, written = (
        step_function(axis, stepping, inline)(x, w, axis.parameters.values)
        for inline in (False, True)
    )
    scaled = (called - written).full().ravel() / axis.state_scales
    assert np.abs(scaled).max() < 1e-14


def test_many_steps_a_sample_are_little_more_code(made):
    """Every call of a step is code: 48 calls in a row took seconds to compile."""
    axis = made.true_axis()
    few, many = (
        len(generate_code([step_function(axis, Stepping(1e-2, substeps=n))])) for n in (4, 48)
    )
    assert many < 3 * few


def test_what_disturbs_the_commands_does_not_disturb_the_supply(made):
    axis, x_ref, x_0 = made.supplied_axis(), np.full(20, 0.01), [3.8e5, 4.4e5, 0.0, 0.0]
    added = np.full(20, 0.3)
    plain, disturbed = (
        simulate_closed_loop(axis, x_ref, 1e-3, x_0, disturbance=each) for each in (None, added)
    )
    assert np.all(plain["p_supply"] == made.P_SUPPLY)
    assert np.all(disturbed["p_supply"] == made.P_SUPPLY)
    for name in axis.kind.commands:
        assert disturbed[name][0] == pytest.approx(plain[name][0] + 0.3)
    whole = np.column_stack([added, added, np.full(20, 6e5)])
    low = simulate_closed_loop(axis, x_ref, 1e-3, x_0, disturbance=whole)
    assert np.all(low["p_supply"] == 6e5)
