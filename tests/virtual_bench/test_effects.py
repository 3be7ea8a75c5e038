"""Hidden effects: all of the catalogue are there, all run, each does what it says."""

from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.errors import ModelError
from pneumo_casadi.virtual_bench import (
    FORMS,
    Excitation,
    Experiment,
    Severity,
    effects_for,
    simulate_axis,
)
from pneumo_casadi.virtual_bench.catalogue import ALL_FORMS
from pneumo_casadi.virtual_bench.effect import effect_at_severity
from pneumo_casadi.virtual_bench.kernels import layout

LISTED = {
    *("stribeck", "presliding", "pressure_friction", "position_friction", "quadratic_drag"),
    *("constant_force", "spring_load", "elastic_load", "backlash", "piston_seal_leakage"),
    *("leakage_P", "leakage_N", "heat_transfer", "valve_dynamics", "valve_dead_zone"),
    *("valve_null_shift", "valve_hysteresis", "valve_mismatch", "flow_map_shape", "hose"),
    *("supply_droop", "exhaust_restriction", "pressure_sensor_lag", "pressure_sensor_bias"),
    "position_delay",
}


@pytest.fixture(scope="module")
def brief(axis):
    """Half a second at 1 kHz: every effect is felt in it."""
    return Experiment.of("chirp_and_squares").excitation(axis, 1000.0, 0.5, seed=3)


@pytest.fixture(scope="module")
def nominal(axis, brief):
    return simulate_axis(axis.with_ideal_sensors(), brief)


def hidden(axis, drive, name, how="medium"):
    axis = axis.with_ideal_sensors()
    return simulate_axis(axis, drive, effects_for(axis, {name: how}))


def test_every_effect_of_the_catalogue_is_there_and_some_that_are_not():
    assert {name for name, form in FORMS.items() if form.listed} == LISTED
    assert sum(not form.listed for form in FORMS.values()) >= 5


@pytest.mark.slow
@pytest.mark.parametrize("name", list(FORMS))
def test_every_severity_runs_differs_from_nominal_and_grows(axis, brief, nominal, name):
    channels = slice(2, 5)
    size = np.ptp(nominal.rows[:, channels], axis=0)
    gaps = []
    for severity in Severity:
        rows = hidden(axis, brief, name, severity).rows
        assert np.isfinite(rows).all()
        apart = (rows - nominal.rows)[:, channels] / size
        gaps.append(float(np.sqrt((apart**2).mean())))
    assert gaps[0] > 1e-6
    assert gaps[0] < gaps[1] < gaps[2]


@pytest.mark.parametrize("form", list(FORMS.values()), ids=list(FORMS))
def test_labels_are_complete(axis, form):
    label = effect_at_severity(form, Severity.MEDIUM, axis).as_dict()
    assert label["note"]
    assert label["equation"]
    assert all(size.unit and size.description for size in form.sizes)
    assert all(np.isfinite(entry["value"]) for entry in label["parameters"].values())


def test_sizes_follow_the_axis_and_scatter_with_the_seed_only(axis):
    heavy = replace(axis, F_c_plus=2 * axis.F_c_plus, F_c_minus=2 * axis.F_c_minus)

    def delta_F(of, seed=None) -> float:
        return effects_for(of, {"stribeck": "large"}, seed)[0].parameters["delta_F"]

    assert delta_F(heavy) == pytest.approx(2 * delta_F(axis))
    assert delta_F(axis, 1) == delta_F(axis, 1) != delta_F(axis, 2)
    assert delta_F(axis, 1) == pytest.approx(delta_F(axis), rel=0.2)


@pytest.mark.parametrize("asked", [{"rust": "medium"}, {"hose": "huge"}, {"hose": {"bore": 1.0}}])
def test_what_the_bench_does_not_know_is_refused_with_what_it_knows(axis, asked):
    with pytest.raises(ModelError, match="there are"):
        effects_for(axis, asked)


def test_stribeck_friction_breaks_away_above_coulomb(axis, drive):
    run = hidden(axis, drive, "stribeck", {"delta_F": 10.0})
    y, held = run.states, run.modes == layout.HELD
    ambient = (axis.S_P - axis.S_N) * axis.p_ext
    force = axis.S_P * y[:, layout.GAS_P] - axis.S_N * y[:, layout.GAS_N] - ambient
    assert force[held].max() <= axis.F_c_plus + 10.0 + 1e-6
    assert force[held].max() > axis.F_c_plus + 5.0


def test_bristles_give_way_before_the_piston_slides(axis):
    """Below breakaway a force bends them by its share of the slip distance."""
    axis = replace(axis, F_c_plus=40.0, F_c_minus=40.0).with_ideal_sensors()
    still = Excitation(np.zeros(10), np.zeros(10))

    def rest(F_0: float) -> float:
        asked = {"presliding": {"distance": 4e-4}, "constant_force": {"F_0": F_0}}
        return simulate_axis(axis, still, effects_for(axis, asked)).states[-1, layout.X]

    given = rest(4.0) - rest(0.0)
    # Initial stiffness: the mean of level / slip distance over the four bristles.
    assert given == pytest.approx(4.0 / 40.0 * 4e-4 / 1.302, rel=0.1)


def test_a_delay_shifts_the_position_by_exactly_its_time(axis, drive):
    run = hidden(axis, drive, "position_delay", {"T": 0.004})
    true = run.states[:, layout.X]
    np.testing.assert_allclose(run.rows[4:, 4], true[:-4], atol=1e-12)


def test_play_holds_the_shown_position_at_reversals(axis, drive):
    run = hidden(axis, drive, "backlash", {"gap": 1e-3})
    behind = run.states[:, layout.X] - run.rows[:, 4]
    assert np.abs(behind).max() <= 5e-4 + 1e-12
    moving = np.abs(np.diff(run.rows[:, 4])) > 1e-7
    np.testing.assert_allclose(np.abs(behind[1:][moving]), 5e-4, atol=1e-12)


def test_bias_is_what_the_sensors_show_too_much(axis, drive):
    run = hidden(axis, drive, "pressure_sensor_bias", {"P": 5000.0, "N": -2000.0})
    np.testing.assert_allclose(run.rows[:, 2] - run.states[:, layout.GAS_P], 5000.0, atol=1e-6)
    np.testing.assert_allclose(run.rows[:, 3] - run.states[:, layout.GAS_N], -2000.0, atol=1e-6)


def test_droop_empties_the_reservoir_and_a_silencer_holds_pressure(axis, drive):
    y = hidden(axis, drive, "supply_droop", "large").states[:, layout.P_SUPPLY]
    assert 0.7 * axis.p_supply < y.min() < 0.98 * axis.p_supply
    assert y.max() < 1.02 * axis.p_supply
    p_e = hidden(axis, drive, "exhaust_restriction", "large").states[:, layout.P_EXHAUST]
    assert p_e.min() >= axis.p_ext - 1.0
    assert p_e.max() > 1.02 * axis.p_ext


def momentum_and_force(axis, y, m_2, velocity):
    """Rate of the momentum of both masses, and the force on them, while the piston slides."""
    v = y[:, layout.V]
    sliding = (np.abs(v[:-2]) > 1e-2) & (np.abs(v[2:]) > 1e-2) & (v[:-2] * v[2:] > 0)
    gas = axis.S_P * y[:, layout.GAS_P] - axis.S_N * y[:, layout.GAS_N]
    F_c = np.where(v > 0, axis.F_c_plus, -axis.F_c_minus)
    force = gas - (axis.S_P - axis.S_N) * axis.p_ext - axis.f_v * v - F_c
    momentum = (axis.M - m_2) * v + m_2 * y[:, velocity]
    rate = (momentum[2:] - momentum[:-2]) / 2e-3
    return rate[sliding], force[1:-1][sliding]


def test_the_forces_on_both_masses_of_an_elastic_load_add_up(axis, drive):
    m_2 = 5.0
    y = hidden(axis, drive, "elastic_load", {"m_2": m_2, "f": 8.0, "zeta": 0.05}).states
    np.testing.assert_allclose(*momentum_and_force(axis, y, m_2, layout.V_2), atol=0.3)
    assert np.abs(y[:, layout.X_2] - y[:, layout.X]).max() > 1e-4


def test_a_load_beyond_a_play_is_only_pushed_and_moves_as_it_is_pushed(axis, drive):
    m_2, gap = 5.0, 3e-3
    sizes = {"m_2": m_2, "gap": gap, "f": 40.0, "zeta": 0.15}
    y = hidden(axis, drive, "backlash_two_masses", sizes).states
    np.testing.assert_allclose(*momentum_and_force(axis, y, m_2, layout.V_3), atol=2.0)
    apart = y[:, layout.X] - y[:, layout.X_3]
    pushed = np.gradient(y[:, layout.V_3], 1e-3)[2:-2]
    within = (np.abs(apart) < 0.4 * gap)[2:-2]
    assert within.any() and np.abs(pushed[within]).max() < 0.02 * np.abs(pushed).max()
    assert np.all(pushed[apart[2:-2] > 0.6 * gap] > -1e-6)


def test_the_sensor_of_the_measured_form_is_at_the_load_beyond_the_play(axis, drive):
    effect = effects_for(axis, {"backlash_two_masses_measured": "medium"})
    run = simulate_axis(axis.with_ideal_sensors(), drive, effect)
    np.testing.assert_allclose(run.rows[:, 4], run.states[:, layout.X_3], atol=1e-9)


def test_a_lag_acts_on_the_pressure_where_the_sensor_sits(axis, drive):
    """With the sensor at the valve it follows the pressure of the hose, not that of the chamber."""
    tau = 0.02
    axis = axis.with_ideal_sensors()
    forms = {"hose_volume_at_valve": "large", "pressure_sensor_lag_first_order": {"tau": tau}}
    run = simulate_axis(axis, drive, effects_for(axis, forms))
    at_valve, shown = run.states[:, layout.LINE_P], run.rows[:, 2]
    dt = float(run.t[1] - run.t[0])
    slope = np.gradient(shown, dt)[5:-5]
    behind = (at_valve - shown)[5:-5]
    assert np.std(behind - tau * slope) < 0.02 * np.std(behind)


@pytest.mark.parametrize("form", ["pressure_sensor_lag", "pressure_sensor_lag_first_order"])
def test_a_lag_shorter_than_a_step_is_followed_as_well(axis, brief, form):
    """Its second order grew to 1e20 Pa."""
    axis = axis.with_ideal_sensors()
    run = simulate_axis(axis, brief, effects_for(axis, {form: {"tau": 4e-5}}))
    chamber, shown = run.states[:, layout.GAS_P], run.rows[:, 2]
    dt = float(run.t[1] - run.t[0])
    fastest = np.abs(np.gradient(chamber, dt)).max()
    assert np.abs(shown - chamber).max() < 2 * 4e-5 * fastest + 1.0


def test_a_lag_too_short_to_be_followed_is_refused(axis, brief):
    with pytest.raises(ModelError, match=r"tau = 1e-09 s is too short .* 1e-05 s is the least"):
        simulate_axis(axis, brief, effects_for(axis, {"pressure_sensor_lag": {"tau": 1e-9}}))


def test_what_makes_a_form_is_the_same_on_every_axis(axis):
    for name, exponent in (("stribeck", 1.0), ("stribeck_gaussian", 2.0)):
        drawn = [
            effect_at_severity(ALL_FORMS[name], Severity.LARGE, axis, seed) for seed in range(5)
        ]
        assert {effect.parameters["exponent"] for effect in drawn} == {exponent}
        assert len({effect.parameters["delta_F"] for effect in drawn}) == 5


def test_two_effects_of_one_cause_are_refused(axis, brief):
    both = effects_for(axis, {"stribeck": "large", "stribeck_gaussian": "small"})
    with pytest.raises(ModelError, match="stribeck: two effects of one cause"):
        simulate_axis(axis, brief, both)


def test_a_delay_is_not_simulated_under_a_clock_with_jitter(axis, brief):
    late = effects_for(axis, {"position_delay": "large"})
    with pytest.raises(ModelError, match="record without jitter"):
        simulate_axis(axis, brief, late, jitter=0.1)
