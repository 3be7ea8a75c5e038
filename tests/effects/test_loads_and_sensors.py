"""Loads and sensors against their laws: energy, resonance, delay, play."""

import numpy as np
import pytest

from pneumo_casadi.effects import (
    Backlash,
    BacklashBeforeLoad,
    ConstantForce,
    DriveLag,
    ElasticLoad,
    ElasticLoadProgressive,
    GainError,
    PositionDelay,
    PositionOnGuidedLoad,
    PositionOnLoadWithPlay,
    PositionOnProgressiveLoad,
    PressureSensorBias,
    PressureSensorLag,
    SpringLoad,
    SpringLoadProgressive,
    SpringLoadTwoSided,
)
from pneumo_casadi.model.simulation import simulate

SMOOTH = {"f_v": 0.0, "F_c_plus": 0.0, "F_c_minus": 0.0}


def free(axis, x_0, seconds=1.0, F=0.0, dt=1e-3):
    """Let a force-driven axis run under a constant force."""
    return simulate(axis, np.full((round(seconds / dt), 1), F), dt, x_0)


def poles(axis):
    n = len(axis.states)
    x = axis.rest([0.0, 0.0], [0.0], axis.parameters.values)
    return np.linalg.eigvals(
        axis.rhs.jacobian()(x, [0.0], axis.parameters.values, 0)[0].full()[:, :n]
    )


def test_a_spring_conserves_energy_and_swings_at_its_frequency(made):
    axis = made.true_force_axis(SpringLoad()).with_parameters(SMOOTH | {"spring_load.k": 400.0})
    M = axis.parameters["M"].value
    run = free(axis, [0.05, 0.0])
    energy = 0.5 * M * run["v"] ** 2 + 0.5 * 400.0 * run["x"] ** 2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)
    np.testing.assert_allclose(run["x"], 0.05 * np.cos(np.sqrt(400.0 / M) * run.t), atol=1e-9)


@pytest.mark.parametrize(
    ("effect", "values", "force"),
    [
        (
            SpringLoadProgressive,
            {"k": 100.0, "beta": 100.0, "x_0": 0.02},
            {0.12: -20.0, -0.08: 20.0},
        ),
        (SpringLoadTwoSided, {"k_minus": 50.0, "k_plus": 300.0}, {0.1: -30.0, -0.1: 5.0}),
        (SpringLoadTwoSided, {"k_plus": 300.0, "x_0": 0.04}, {0.1: -18.0, -0.1: 0.0}),
    ],
)
def test_a_spring_pulls_back_by_its_law_on_either_side(made, effect, values, force):
    own = {f"{effect.name}.{name}": value for name, value in values.items()}
    axis = made.true_force_axis(effect()).with_parameters(SMOOTH | own)
    for x, expected in force.items():
        acceleration = float(axis.rhs([x, 0.0], [0.0], axis.parameters.values)[1])
        assert axis.parameters["M"].value * acceleration == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("phi", [0.0, 0.3, 1.0])
def test_friction_of_a_guided_load_acts_at_its_own_velocity(made, phi):
    """Both masses together get the force less friction at the velocity of each; rigid, at one."""
    own = {"D": 0.05, "s": 0.4, "zeta": 0.05, "phi": phi}
    axis = made.true_axis(PositionOnGuidedLoad()).with_parameters(
        {"F_c_plus": 0.0, "F_c_minus": 0.0, "f_v": 40.0}
        | {f"position_on_guided_load.{name}": value for name, value in own.items()}
    )
    x, u = [4.2e5, 5.1e5, 0.02, 0.3], [0.2, -0.2]
    M, f_v = axis.parameters["M"].value, axis.parameters["f_v"].value
    g = 40.0
    rates = axis.rhs([*x, 35.0, g], u, axis.parameters.values).full().ravel()
    compliance = 0.05**2 / (0.6 * M)
    sliding, parting = compliance * np.array([g, rates[5]]) / 0.05
    nominal = made.true_axis().with_parameters({"F_c_plus": 0.0, "F_c_minus": 0.0, "f_v": 0.0})
    driving = M * float(nominal.rhs(x, u, nominal.parameters.values)[3])
    friction = f_v * (phi * x[3] + (1 - phi) * (x[3] + sliding))
    together = 0.4 * M * rates[3] + 0.6 * M * (rates[3] + parting)
    assert together == pytest.approx(driving - friction, rel=2e-3)
    at_rest = axis.rest(x, u, axis.parameters.values)
    assert axis.rhs(at_rest, u, axis.parameters.values).full().ravel()[4:] == pytest.approx(0.0)
    rigid = axis.with_parameters({"position_on_guided_load.D": 0.0})
    plain = nominal.with_parameters({"f_v": f_v})
    moved = rigid.rhs(at_rest, u, rigid.parameters.values).full().ravel()[:4]
    assert moved == pytest.approx(plain.rhs(x, u, plain.parameters.values).full().ravel())


def test_an_elastic_load_conserves_momentum_and_loses_what_its_damper_takes(made):
    values = {"elastic_load.m_2": 6.0, "elastic_load.f": 8.0, "elastic_load.zeta": 0.01}
    axis = made.true_force_axis(ElasticLoad()).with_parameters(SMOOTH | values)
    M, omega = axis.parameters["M"].value, 2 * np.pi * 8.0
    run = free(axis, [0.0, 0.3, 0.01, -0.2])
    v, x_2, v_2 = run["v"], run["elastic_load.x_2"], run["elastic_load.v_2"]
    energy = 0.5 * (M * v**2 + 6.0 * v_2**2 + 6.0 * omega**2 * (x_2 - run["x"]) ** 2)
    power = 2 * 6.0 * 0.01 * omega * (v_2 - v) ** 2
    lost = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(run.t))])
    assert lost[-1] > 0.05 * energy[0]
    np.testing.assert_allclose(energy + lost, energy[0], rtol=1e-4)
    np.testing.assert_allclose(M * v + 6.0 * v_2, M * 0.3 - 6.0 * 0.2, rtol=1e-9)


def test_an_elastic_load_on_rubber_conserves_energy_and_momentum(made):
    own = {"m_2": 6.0, "f": 8.0, "zeta": 0.01, "beta": 4e4}
    axis = made.true_force_axis(ElasticLoadProgressive()).with_parameters(
        SMOOTH | {f"elastic_load_progressive.{name}": value for name, value in own.items()}
    )
    M, omega = axis.parameters["M"].value, 2 * np.pi * 8.0
    run = free(axis, [0.0, 0.3, 0.01, -0.2])
    v, x_2, v_2 = run["v"], *(run[f"elastic_load_progressive.{state}"] for state in ("x_2", "v_2"))
    stretch = x_2 - run["x"]
    assert 4e4 * np.max(stretch**2) > 2.0  # its stiffness has more than trebled
    stored = 6.0 * omega**2 * (stretch**2 / 2 + 4e4 * stretch**4 / 4)
    energy = 0.5 * (M * v**2 + 6.0 * v_2**2) + stored
    power = 2 * 6.0 * 0.01 * omega * (v_2 - v) ** 2
    lost = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(run.t))])
    np.testing.assert_allclose(energy + lost, energy[0], rtol=2e-3)
    np.testing.assert_allclose(M * v + 6.0 * v_2, M * 0.3 - 6.0 * 0.2, rtol=1e-9)


def test_a_load_on_rubber_whose_position_is_measured_is_pulled_by_the_cube_of_the_stretch(made):
    """Beside the linear spring's, at one state: the load gains β δ² e over its mass."""
    name = "position_on_progressive_load"
    own = {"D": 0.05, "s": 0.4, "zeta": 0.05, "phi": 0.3, "beta": 0.0}
    axis = made.true_axis(PositionOnProgressiveLoad()).with_parameters(
        SMOOTH | {f"{name}.{short}": value for short, value in own.items()}
    )
    x, u = [4.2e5, 5.1e5, 0.02, 0.3, 200.0, 40.0], [0.2, -0.2]
    M = axis.parameters["M"].value
    stretch = 0.05**2 / (0.6 * M) * 200.0
    stiffened = axis.with_parameters({f"{name}.beta": 1.0 / stretch**2})
    before, after = (
        each.rhs(x, u, each.parameters.values).full().ravel() for each in (axis, stiffened)
    )
    for each in (axis, stiffened):  # at rest nothing swings
        at_rest = each.rest(x[:4], u, each.parameters.values)
        assert each.rhs(at_rest, u, each.parameters.values).full().ravel()[4:] == pytest.approx(
            0.0, abs=1e-6
        )
    assert M * (after[3] - before[3]) == pytest.approx(200.0, rel=0.01)
    assert after[5] - before[5] == pytest.approx(-200.0 / 0.05, rel=0.05)


def test_a_load_beyond_a_play_flies_on_until_it_is_caught(made):
    """The piston stops; the load crosses the play at its speed, and momentum is conserved."""
    own = {"m_2": 6.0, "gap": 4e-3, "f": 40.0, "zeta": 0.3}
    axis = made.true_force_axis(BacklashBeforeLoad()).with_parameters(
        SMOOTH | {f"backlash_before_load.{name}": value for name, value in own.items()}
    )
    M = axis.parameters["M"].value
    run = free(axis, [0.0, 0.0, -1.9e-3, 0.2], 0.1, dt=1e-4)
    x_2, v_2 = (run[f"backlash_before_load.{state}"] for state in ("x_2", "v_2"))
    flying = run.t < 0.018  # 3.9 mm at 0.2 m/s take 20 ms
    np.testing.assert_allclose(v_2[flying], 0.2, rtol=1e-3)
    np.testing.assert_allclose(run["v"][flying], 0.0, atol=1e-3)
    assert run["v"][run.t > 0.03].min() > 0.03  # now the load pulls the piston along
    np.testing.assert_allclose(M * run["v"] + 6.0 * v_2, 6.0 * 0.2, rtol=1e-9)
    assert np.max(x_2 - run["x"]) > 2e-3


@pytest.mark.parametrize("D", [0.0, 1e-5, 1e-4, 1e-3, 2.5e-3])
@pytest.mark.parametrize("v", [0.3, -0.3])
def test_a_load_with_play_whose_position_is_measured_begins_with_the_force_it_carries(made, D, v):
    """Whatever the contact gives, and with the motion or against it."""
    own = {"D": D, "s": 0.4, "zeta": 0.3, "phi": 0.3, "gap": 1e-3}
    axis = made.true_axis(PositionOnLoadWithPlay()).with_parameters(
        {f"position_on_load_with_play.{name}": value for name, value in own.items()}
    )
    x, u = [4.2e5, 5.1e5, 0.02, v], [0.2, -0.2]
    begun = axis.rest(x, u, axis.parameters.values)
    plain = made.true_axis()
    at_rest, nominal = (
        each.rhs(state, u, each.parameters.values).full().ravel()
        for each, state in ((axis, begun), (plain, x))
    )
    assert at_rest[4:] * 1e-3 == pytest.approx(
        0.0, abs=1.0
    )  # of some hundred newtons a millisecond
    assert at_rest[3] == pytest.approx(nominal[3], rel=0.02, abs=0.05)


def test_within_the_play_no_force_reaches_a_load_whose_position_is_measured(made):
    own = {"D": 2.5e-3, "s": 0.4, "zeta": 0.3, "phi": 0.0, "gap": 4e-3}
    axis = made.true_axis(PositionOnLoadWithPlay()).with_parameters(
        SMOOTH | {f"position_on_load_with_play.{name}": value for name, value in own.items()}
    )
    M = axis.parameters["M"].value
    compliance = 2.5e-3**2 / (0.6 * M)
    accelerations = [
        float(axis.rhs([4.2e5, 5.1e5, 0.02, 0.3, apart / compliance, 0.0], [0.2, -0.2],
                       axis.parameters.values)[3])
        for apart in (1e-3, 1.9e-3)
    ]  # fmt: skip
    touched = axis.rhs(
        [4.2e5, 5.1e5, 0.02, 0.3, 2.1e-3 / compliance, 0.0], [0.2, -0.2], axis.parameters.values
    )
    assert float(touched[3]) - accelerations[1] == pytest.approx(1e-4 / compliance / M, rel=0.05)
    assert accelerations[0] == pytest.approx(accelerations[1], abs=0.02 * 1e-4 / compliance / M)


def test_an_elastic_load_resonates_above_its_own_frequency_and_counts_as_mass_below(made):
    values = {"elastic_load.m_2": 6.0, "elastic_load.f": 8.0, "elastic_load.zeta": 0.02}
    axis = made.true_force_axis(ElasticLoad()).with_parameters(SMOOTH | values)
    M = axis.parameters["M"].value
    computed = np.abs(poles(axis)).max() / (2 * np.pi)
    assert computed == pytest.approx(8.0 * np.sqrt(1 + 6.0 / M), rel=1e-9)
    run = free(axis, [0.0, 0.0], 3.0, F=50.0)
    assert run["v"][-1] == pytest.approx(50.0 * run.t[-1] / (M + 6.0), rel=0.01)


def test_coulomb_friction_absorbs_a_constant_force_exactly(made):
    axis = made.true_force_axis(ConstantForce()).with_parameters({"constant_force.F_0": 4.0})
    level = axis.parameters.as_dict()
    shifted = made.true_force_axis().with_parameters(
        {"F_c_plus": level["F_c_plus"] - 4.0, "F_c_minus": level["F_c_minus"] + 4.0}
    )
    u = 60 * np.sin(np.arange(800) / 90)[:, None]
    first, second = (simulate(a, u, 1e-3, [0.0, 0.0])["x"] for a in (axis, shifted))
    np.testing.assert_allclose(first, second, rtol=1e-9, atol=1e-12)


def test_mass_and_friction_absorb_a_gain_error_exactly(made):
    axis = made.true_force_axis(GainError()).with_parameters({"gain_error.gamma": np.log(1.1)})
    nominal = made.true_force_axis()
    names = ("M", "f_v", "F_c_plus", "F_c_minus")
    lighter = nominal.with_parameters({n: nominal.parameters[n].value / 1.1 for n in names})
    u = 60 * np.sin(np.arange(800) / 90)[:, None]
    first, second = (simulate(a, u, 1e-3, [0.0, 0.0])["x"] for a in (axis, lighter))
    np.testing.assert_allclose(first, second, rtol=1e-9, atol=1e-12)


def test_the_drive_lag_answers_a_step_of_force_like_a_lag(made):
    """In velocity a lag is late by τ, whatever its regular zero."""
    axis = made.true_force_axis(DriveLag()).with_parameters(SMOOTH | {"drive_lag.tau": 0.01})
    x_0 = [0.0, 0.0, 0.0]  # no force so far
    run = free(axis, x_0, 0.2, F=36.0)
    M = axis.parameters["M"].value
    assert run["v"][-1] == pytest.approx(36.0 / M * (run.t[-1] - 0.01), rel=1e-6)
    assert poles(axis).real.min() == pytest.approx(-1 / 0.011, rel=1e-9)


def play(x, gap):
    """Rate-independent play, sample by sample: the textbook operator."""
    y, at = np.empty_like(x), x[0] - gap / 2
    for i, value in enumerate(x):
        at = min(max(at, value - gap / 2), value + gap / 2)
        y[i] = at
    return y


@pytest.mark.parametrize("gap", [1e-4, 1e-3, 3e-3])
def test_backlash_is_the_play_operator_but_for_its_millisecond_of_contact(made, drag, gap):
    axis = made.true_force_axis(Backlash()).with_parameters({"backlash.gap": gap})
    run = drag(axis, lambda t: 0.03 * np.sin(9 * t) + 2e-3 * np.sin(41 * t), 1.5)
    error = run.y[0] - play(run.x, gap)
    assert np.sqrt(np.mean(error**2)) < 0.04 * gap + 2e-6
    assert np.abs(run.y[0] - run.x).max() == pytest.approx(gap / 2, rel=0.02)


def test_the_sensor_stands_still_within_the_play(made, drag):
    axis = made.true_force_axis(Backlash()).with_parameters({"backlash.gap": 1e-3})
    run = drag(axis, lambda t: 4e-4 * np.sin(20 * t), 1.0)
    shown, moved = (np.ptp(part[run.t > 0.5]) for part in (run.y[0], run.x))
    assert shown < 0.01 * moved


@pytest.mark.parametrize("T", [5e-4, 2e-3, 1e-2])
def test_the_position_delay_shows_where_the_axis_was(made, drag, T):
    def motion(t):
        return 0.05 * np.sin(2 * np.pi * 1.5 * t) + 2e-3 * np.sin(2 * np.pi * 9.0 * t)

    axis = made.true_force_axis(PositionDelay()).with_parameters({"position_delay.T": T})
    run = drag(axis, motion, 1.0)
    late = run.t > 0.1
    error = run.y[0] - motion(run.t - T)
    assert np.abs(error[late]).max() < 5e-4 * np.abs(motion(run.t - T) - run.x)[late].max()


def test_the_pressure_sensors_lag_by_their_time_constant(made):
    axis = made.true_axis(PressureSensorLag()).with_parameters({"pressure_sensor_lag.tau": 0.02})
    f, theta = axis.rhs.jacobian(), axis.parameters.values
    x, u = [4e5, 5e5, 0.0, 0.0, 4e5, 5e5], [0.5, -0.5]
    A = f(x, u, theta, 0)[0].full()
    np.testing.assert_allclose(A[4:, 4:], -np.eye(2) / 0.021, rtol=1e-12)
    C = axis.output.jacobian()(x, u, theta, 0)[0].full()[:2]
    # Transfer from the pressures, C (s - A)⁻¹ B + D: 1 at s = 0, and -τ s above it.
    B = A[4:, :2]
    late = np.linalg.solve(A[4:, 4:], B)
    np.testing.assert_allclose(C[:, :2] - C[:, 4:] @ late, np.eye(2), atol=1e-12)
    slope = -C[:, 4:] @ np.linalg.solve(A[4:, 4:], late)
    np.testing.assert_allclose(slope, -0.02 * np.eye(2), atol=1e-12)


def test_pressure_sensors_show_their_offsets_and_nothing_else_changes(made):
    axis = made.true_axis(PressureSensorBias()).at_starting_values()
    b_P, b_N = (item.start for item in PressureSensorBias.parameters)
    nominal, x, u = made.true_axis(), [4e5, 5e5, 0.02, 0.1], [0.5, -0.5]
    shown, plain = (a.output(x, u, a.parameters.values).full() for a in (axis, nominal))
    np.testing.assert_allclose((shown - plain).ravel(), [b_P, b_N, 0.0], atol=1e-9)
    first, second = (a.rhs(x, u, a.parameters.values).full() for a in (axis, nominal))
    np.testing.assert_array_equal(first, second)
