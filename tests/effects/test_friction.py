"""Friction effects against their laws, and against solvers of their own."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pneumo_casadi.effects import (
    PositionFriction,
    PositionFrictionStep,
    Presliding,
    PreslidingDahl,
    PreslidingMaxwell,
    PressureFriction,
    QuadraticDrag,
    QuadraticDragPerDirection,
    Stribeck,
    StribeckFilm,
)


def resistance(axis, x=0.0, v=0.3, p=(4e5, 5e5)):
    """Force against motion at one state, effects' states at rest."""
    theta, u = axis.parameters.values, np.zeros(len(axis.inputs))
    full = axis.rest([*p, x, v], u, theta)
    S_P, S_N, p_ext = (axis.constants[name] for name in ("S_P", "S_N", "p_ext"))
    effort = S_P * p[0] - S_N * p[1] - (S_P - S_N) * p_ext
    return effort - axis.parameters["M"].value * float(axis.rhs(full, u, theta)[3])


def added(axis, made, **state):
    return resistance(axis, **state) - resistance(made.true_axis(), **state)


def test_stribeck_friction_falls_to_1_over_e_at_its_velocity(made):
    axis = made.true_axis(Stribeck()).with_parameters({"stribeck.delta_F": 9.0})
    v = axis.parameters["stribeck.v_stribeck"].value
    for sign in (1, -1):
        expected = sign * 9.0 * np.exp(-1) * np.tanh(v / made.TRUE["v_s"])
        assert added(axis, made, v=sign * v) == pytest.approx(expected, rel=1e-9)
    assert added(axis, made, v=10 * v) == pytest.approx(0.0, abs=1e-9)


def test_a_film_lags_the_speed_and_falls_to_1_over_e_at_its_velocity(made):
    name = "stribeck_film"
    values = {"delta_F": 9.0, "v_stribeck": 0.03, "tau": 0.2}
    axis = made.true_axis(StribeckFilm()).with_parameters(
        {f"{name}.{key}": value for key, value in values.items()}
    )
    for sign in (1, -1):  # a record begins with the film of its speed
        assert added(axis, made, v=sign * 0.03) == pytest.approx(sign * 9.0 / np.e, rel=1e-6)
    theta, u = axis.parameters.values, np.zeros(len(axis.inputs))
    after_rest = np.array([4e5, 5e5, 0.0, -0.3, 0.0])
    rates = axis.rhs(after_rest, u, theta).full().ravel()
    assert rates[4] == pytest.approx(0.3 / 0.2, rel=1e-6)
    steady = axis.rhs([*after_rest[:4], 0.3], u, theta).full().ravel()
    M = axis.parameters["M"].value
    assert M * (rates[3] - steady[3]) == pytest.approx(9.0 * (1 - np.exp(-10)), rel=1e-6)


def test_pressure_friction_follows_the_gauge_pressure_of_both_chambers(made):
    axis = made.true_axis(PressureFriction()).with_parameters({"pressure_friction.k_p": 2e-5})
    assert added(axis, made, p=(1e5, 1e5)) == pytest.approx(0.0, abs=1e-9)
    for p in ((6e5, 1e5), (1e5, 6e5), (3.5e5, 3.5e5)):
        assert added(axis, made, p=p) == pytest.approx(10.0)
        assert added(axis, made, p=p, v=-0.3) == pytest.approx(-10.0)


def test_position_friction_has_a_slope_and_a_tight_spot_and_reverses_with_the_motion(made):
    axis = made.true_axis(PositionFriction()).at_starting_values()
    value = {item.name: item.start for item in PositionFriction.parameters}
    for x in (-0.1, value["centre"], value["centre"] + value["width"]):
        spot = np.exp(-(((x - value["centre"]) / value["width"]) ** 2))
        expected = value["slope"] * x + value["height"] * spot
        assert added(axis, made, x=x) == pytest.approx(expected, abs=1e-9)
        assert added(axis, made, x=x, v=-0.3) == pytest.approx(-expected, abs=1e-9)


def test_friction_that_steps_is_larger_on_one_side_and_reverses_with_the_motion(made):
    values = {"step": 6.0, "edge": 0.04, "width": 0.005}
    own = {f"position_friction_step.{name}": value for name, value in values.items()}
    axis = made.true_axis(PositionFrictionStep()).with_parameters(own)
    for x, expected in ((0.0, -3.0), (0.04, 0.0), (0.08, 3.0)):
        assert added(axis, made, x=x) == pytest.approx(expected, abs=1e-5)
        assert added(axis, made, x=x, v=-0.3) == pytest.approx(-expected, abs=1e-5)


def test_quadratic_drag_takes_power_with_the_cube_of_the_speed(made):
    axis = made.true_axis(QuadraticDrag()).with_parameters({"quadratic_drag.c": 50.0})
    power = [v * added(axis, made, v=v) for v in (0.2, 0.4, -0.4)]
    np.testing.assert_allclose(power, [50 * 0.2**3, 50 * 0.4**3, 50 * 0.4**3], rtol=1e-9)


def test_a_damper_with_a_check_valve_drags_by_the_coefficient_of_each_direction(made):
    name = "quadratic_drag_per_direction"
    axis = made.true_axis(QuadraticDragPerDirection()).with_parameters(
        {f"{name}.c_plus": 50.0, f"{name}.c_minus": 8.0}
    )
    drag = [added(axis, made, v=v) for v in (0.4, -0.4)]
    np.testing.assert_allclose(drag, [50 * 0.4**2, -8 * 0.4**2], rtol=1e-9)


def sliding(made, distance, effect=Presliding):
    """A force-driven axis of Coulomb friction 15 N alone, sharp, with presliding."""
    bare = {"f_v": 0.0, "F_c_plus": 15.0, "F_c_minus": 15.0, "v_s": 1e-4}
    axis = made.true_force_axis(effect()).with_parameters(bare)
    return axis.with_parameters({f"{effect.name}.distance": distance})


@pytest.mark.parametrize("distance", [1e-4, 3e-4, 1e-3])
def test_presliding_is_the_elastic_plastic_bristle_solved_by_itself(made, drag, distance):
    """Reversals of several sizes; the difference is the regularisation's 5 µm and 1.5 ms."""

    def motion(t):
        return 2e-3 * np.sin(12 * t) + 0.6e-3 * np.sin(61 * t)

    def velocity(t):
        return 24e-3 * np.cos(12 * t) + 36.6e-3 * np.cos(61 * t)

    run = drag(sliding(made, distance), motion, 0.8)

    def bristle(t, h):
        v = velocity(t)
        return (v - 0.5 * (np.abs(v) * h**3 + v * np.abs(h) ** 3)) / distance

    start = [np.sign(velocity(0.0))]
    solved = 15.0 * solve_ivp(bristle, (0, 0.8), start, "LSODA", run.t, max_step=1e-3).y[0]
    error = run.F - solved
    assert np.sqrt(np.mean(error**2)) < 0.04 * 15.0
    without = drag(sliding(made, 0.0), motion, 0.8).F - solved
    assert np.sqrt(np.mean(error**2)) < 0.1 * np.sqrt(np.mean(without**2))


@pytest.mark.parametrize("distance", [3e-4, 1e-3])
def test_maxwells_bristles_slip_one_after_another(made, drag, distance):
    """From -F_c on, against ideal elements: elastic up to their own distance, then constant."""
    run = drag(sliding(made, distance, PreslidingMaxwell), lambda t: 1e-2 * np.cos(3 * t), 2.0)
    back = np.argmin(run.x)
    way = run.x[back:, None] - run.x[back]
    own = distance * np.array([1 / 3, 1.0, 5 / 3])
    expected = 15.0 * np.minimum(-1 + way / own, 1.0).mean(axis=1)
    assert np.abs(run.F[back:] - expected).max() < 0.2 * 15.0  # the corners are round
    assert np.sqrt(np.mean((run.F[back:] - expected) ** 2)) < 0.03 * 15.0
    one = drag(sliding(made, distance), lambda t: 1e-2 * np.cos(3 * t), 2.0)
    worse = np.sqrt(np.mean((one.F[back:] - expected) ** 2))
    assert np.sqrt(np.mean((run.F[back:] - expected) ** 2)) < 0.7 * worse


@pytest.mark.parametrize("distance", [3e-4, 1e-3])
def test_after_a_reversal_dahls_friction_is_an_exponential_of_the_way(made, drag, distance):
    """From -F_c on; the difference is the regularisation's 5 µm."""
    run = drag(sliding(made, distance, PreslidingDahl), lambda t: 1e-2 * np.cos(3 * t), 2.0)
    back = np.argmin(run.x)
    way = run.x[back:] - run.x[back]
    expected = 15.0 * (1 - 2 * np.exp(-way / distance))
    assert np.abs(run.F[back:] - expected).max() < 0.05 * 15.0


@pytest.mark.parametrize(
    ("effect", "stiffer"), [(Presliding, 1.0), (PreslidingMaxwell, (3 + 1 + 0.6) / 3)]
)
def test_far_below_its_distance_presliding_is_a_spring(made, drag, effect, stiffer):
    """Stiffness F_c s₀/(s₀ + s_r)², which is σ₀ = F_c/s₀ where s_r is small against s₀."""
    run = drag(sliding(made, 1e-3, effect), lambda t: 1e-5 * (1 - np.cos(20 * t)), 0.6)
    forward = slice(np.argmax(run.v) - 5, np.argmax(run.v) + 5)
    slope = np.polyfit(run.x[forward], run.F[forward], 1)[0]
    assert slope == pytest.approx(stiffer * 15.0 / 1e-3, rel=0.08)


@pytest.mark.parametrize("effect", [Presliding, PreslidingMaxwell])
def test_after_the_presliding_distance_friction_is_coulombs(made, drag, effect):
    run = drag(sliding(made, 2e-4, effect), lambda t: 0.1 * (1 - np.cos(4 * t)), 0.7)
    assert run.F[run.x > 2e-3] == pytest.approx(15.0, rel=1e-3)


def test_a_bent_bristle_holds_its_force_under_vibration(made, drag):
    """Half a second of 5 µm at 50 Hz: LuGre's, exp(-∫|v|dt/s₀), would keep a fifth of it."""

    def motion(t):
        bend = 1e-4 * np.sin(np.pi * np.minimum(t, 0.1) / 0.2) ** 2
        return bend + np.where(t > 0.1, 5e-6 * np.sin(100 * np.pi * (t - 0.1)), 0.0)

    run = drag(sliding(made, 3e-4), motion, 0.6)
    early, late = (np.mean(run.F[(run.t > t) & (run.t <= t + 0.02)]) for t in (0.1, 0.57))
    assert early == pytest.approx(15.0 / 3, rel=0.05)
    assert 0.85 * early < late <= early
