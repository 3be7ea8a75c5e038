"""Weak effects besides, and further forms of a cause."""

from functools import cache

import numpy as np
import pytest

from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import ModelError
from pneumo_casadi.virtual_bench import (
    ALL_FORMS,
    FORMS,
    Experiment,
    Severity,
    draw_background,
    effects_for,
    forms_of,
    make_case,
    simulate_axis,
    weak_effects,
)
from pneumo_casadi.virtual_bench.catalogue import FEWEST_WEAK, MOST_WEAK, WEAK, WEAK_SCATTER
from pneumo_casadi.virtual_bench.effect import SHORTEST, longest_step
from pneumo_casadi.virtual_bench.kernels import layout

FURTHER = [name for name in ALL_FORMS if name not in FORMS]


def test_every_form_belongs_to_a_cause_with_a_usual_form():
    assert len(FURTHER) >= 20
    for name, form in ALL_FORMS.items():
        assert form.cause in FORMS and forms_of(form.cause)[0] == form.cause
        assert (form.cause == name) == (name in FORMS)
        assert not form.listed or form.cause in EFFECTS
        assert form.listed or form.driver


def test_there_are_unlisted_causes_of_at_least_eight_kinds():
    unlisted = [form for form in FORMS.values() if not form.listed]
    assert len(unlisted) >= 8
    assert {form.driver for form in unlisted} >= {"x", "v", "t"}


@pytest.fixture(scope="module")
def rows(axis):
    """Return a function that runs the axis with some effects for a second, once for each."""
    axis = axis.with_ideal_sensors()
    drive = Experiment.of("chirp_and_squares").excitation(axis, 1000.0, 1.0, seed=3)

    @cache
    def run(*effects):
        return simulate_axis(axis, drive, effects_for(axis, dict(effects))).rows[:, 2:5]

    return run


@pytest.mark.slow
@pytest.mark.parametrize("name", FURTHER)
def test_a_further_form_grows_with_its_severity_and_differs_from_the_usual_one(rows, name):
    nominal = rows()
    size = np.ptp(nominal, axis=0)
    own = [rows((name, severity)) for severity in Severity]
    gaps = [float(np.sqrt((((part - nominal) / size) ** 2).mean())) for part in own]
    assert 1e-6 < gaps[0] < gaps[1] < gaps[2]
    usual = rows((ALL_FORMS[name].cause, Severity.MEDIUM))
    assert np.abs((own[1] - usual) / size).max() > 1e-3


def test_a_background_has_four_to_six_causes_and_none_that_is_left_out():
    for seed in range(40):
        names = draw_background(np.random.default_rng(seed), ["backlash"])
        causes = {ALL_FORMS[name].cause for name in names}
        assert FEWEST_WEAK <= len(names) == len(causes) <= MOST_WEAK
        assert "backlash" not in causes
        assert all(ALL_FORMS[name].strength for name in names)
    usual = draw_background(np.random.default_rng(0), forms_varied=False)
    assert set(usual) <= set(FORMS)


@pytest.mark.parametrize("severity", ["small", "medium"])
def test_weak_effects_are_a_tenth_of_a_severity_with_scatter(axis, severity):
    names = [name for name, form in ALL_FORMS.items() if form.strength]
    for weak in weak_effects(axis, names, 5, Severity(severity)):
        (whole,) = effects_for(axis, {weak.name: severity})
        for quantity, value in weak.parameters.items():
            size = abs(whole.parameters[quantity])
            expected = size * (WEAK if quantity in weak.form.strength else 1.0)
            spread = np.exp(WEAK_SCATTER) if quantity in weak.form.strength else 1.0
            # Sizes at a severity scatter by themselves.
            assert expected / spread / 1.2 <= abs(value) <= expected * spread * 1.2, weak.name


def test_weak_effects_of_unknown_form_are_refused(axis):
    with pytest.raises(ModelError, match="no effect 'rust'"):
        weak_effects(axis, ["rust"], seed=1)


def test_a_case_with_background_is_labelled_and_reproducible(tmp_path):
    options = {"fs": 500.0, "duration": 1.0}
    made = make_case(tmp_path / "a", 4, {"hose_volume": "small"}, background=True, **options)
    again = make_case(
        tmp_path / "b",
        4,
        {"hose_volume": "small"},
        background=[effect.name for effect in made.background],
        **options,
    )
    assert [effect.form.cause for effect in made.effects] == ["hose"]
    assert FEWEST_WEAK <= len(made.labels["background"]) <= MOST_WEAK
    assert made.labels == again.labels
    np.testing.assert_array_equal(made.case.validate[0]["x"], again.case.validate[0]["x"])
    clean = make_case(tmp_path / "c", 4, {"hose_volume": "small"}, **options)
    assert not clean.background
    assert (clean.case.validate[0]["x"] != made.case.validate[0]["x"]).any()


def test_the_sensor_of_an_elastic_load_that_is_measured_shows_the_load(axis, drive):
    axis = axis.with_ideal_sensors()
    run = simulate_axis(axis, drive, effects_for(axis, {"elastic_load_measured": "large"}))
    np.testing.assert_allclose(run.rows[:, 4], run.states[:, layout.X_2], atol=1e-12)
    assert np.abs(run.states[:, layout.X_2] - run.states[:, layout.X]).max() > 1e-4


def test_the_sensors_of_a_hose_show_either_end(axis, drive):
    axis = axis.with_ideal_sensors()
    for name, at in (("hose_volume", layout.GAS_P), ("hose_volume_at_valve", layout.LINE_P)):
        run = simulate_axis(axis, drive, effects_for(axis, {name: "large"}))
        np.testing.assert_allclose(run.rows[:, 2], run.states[:, at], rtol=1e-9)
        assert np.abs(run.states[:, layout.LINE_P] - run.states[:, layout.GAS_P]).max() > 1e4


def test_walls_that_warm_take_the_heat_and_give_it_back(axis, drive):
    axis = axis.with_ideal_sensors()
    run = simulate_axis(axis, drive, effects_for(axis, {"heat_transfer_warm_wall": "large"}))
    assert 0.01 < np.abs(run.states[:, layout.WALL_P]).max() < 60.0
    usual = simulate_axis(axis, drive, effects_for(axis, {"heat_transfer": "large"}))
    assert not usual.states[:, [layout.WALL_P, layout.WALL_N]].any()


def test_no_weak_effect_is_too_fast_for_the_bench(axis):
    fast = [name for name, form in ALL_FORMS.items() if form.time_constant and form.strength]
    assert "pressure_sensor_lag_uneven" in fast
    for name in fast:
        for seed in range(40):
            assert longest_step(weak_effects(axis, [name], seed)) >= SHORTEST


@pytest.mark.parametrize("form", ["backlash_two_masses", "backlash_two_masses_measured"])
def test_a_weak_play_before_a_load_leaves_nearly_all_mass_on_the_piston(axis, form):
    """Three tenths of the mass behind a contact were no weak effect, however narrow the play."""
    (weak,) = weak_effects(axis, [form], 5)
    assert weak.parameters["m_2"] < 0.1 * axis.M
