"""The gap of simulations on held-out records."""

from concurrent.futures import Future
from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.diagnosis import prepare_study
from pneumo_casadi.diagnosis.metrics import simulated_fit
from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels, balance_levels
from pneumo_casadi.diagnosis.metrics.simulated_fit import (
    WINDOW,
    Simulated,
    signal_stds,
    simulate_fit,
    simulate_loop,
)
from pneumo_casadi.diagnosis.metrics.simulated_gap import gap_with_term, simulated_gap
from pneumo_casadi.diagnosis.metrics.simulations import Simulations
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel, fit_model
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.effects.term import Term, term_effect
from pneumo_casadi.metrics import output_noise


@pytest.fixture(scope="module")
def rubbing_study(rubbing_case):
    """A study of hidden friction, and the nominal fit."""
    study, _ = prepare_study(rubbing_case)
    return study, fit_model(study, ())


@pytest.mark.slow
def test_a_discovered_term_is_measured_as_an_effect_is(rubbing_study):
    study, nominal = rubbing_study
    stribeck = (EFFECTS["stribeck"](),)
    final = fit_model(study, stribeck)
    done = Simulations(study)
    levels = balance_levels(study)
    gap, notes = simulated_gap(done, nominal, final, stribeck, levels)
    assert gap.before > 2 * gap.after > 0 and not notes

    worse = replace(final, values={**final.values, "stribeck.delta_F": 80.0})
    _, notes = simulated_gap(done, nominal, worse, stribeck, levels)
    assert ["farther off" in note for note in notes] == [True]

    same = gap_with_term(done, gap, (nominal, ()), levels)
    assert same.with_term == pytest.approx(gap.before)
    closed = gap_with_term(done, gap, (final, stribeck), levels)
    assert closed.with_term == pytest.approx(gap.after)
    for outputs in closed.views.values():
        for values in outputs.values():
            assert values["with_term"] == pytest.approx(values["after"])
    assert gap_with_term(done, gap, None, levels) is gap


def test_a_model_that_is_too_stiff_is_not_simulated(rubbing_study):
    """Such a term was simulated for four minutes, to an error a hundred times the signal."""
    study, nominal = rubbing_study
    law = {"slope": -0.1, "vertex": -1e5}
    term = Term("brake", ("force",), "sign(v)", "p_difference", "absolute value", law)
    brake = (term_effect(term)(),)
    own = {f"brake.{name}": value for name, value in law.items()}
    stiff = replace(nominal, values={**nominal.values, **own})
    for simulated in (
        simulate_fit(study, stiff, brake).windows,
        simulate_loop(study, stiff, brake),
    ):
        assert isinstance(simulated, str) and "stiff" in simulated
    assert not isinstance(simulate_fit(study, nominal, ()).windows, str)


@pytest.mark.slow
def test_windows_need_not_be_whole_blocks_of_samples(rubbing_study):
    """At 1250 Hz those of half a second are one sample shorter: the diagnosis ended there."""
    study, nominal = rubbing_study
    whole, longer = (simulate_fit(study, nominal, (), window) for window in (0.5, 0.501))
    assert not isinstance(whole.windows, str) and not isinstance(longer.windows, str)
    assert longer.windows.shape == whole.windows.shape and np.isfinite(longer.windows).all()


@pytest.mark.slow
def test_short_windows_are_spread_over_the_record_at_any_phase(rubbing_study):
    study, nominal = rubbing_study
    simulated = simulate_fit(study, nominal, (), WINDOW / 5)
    assert len(simulated.runs) == len(study.held_out)
    for record, (rows, _) in zip(study.held_out, simulated.runs, strict=True):
        starts = record.t[rows[:, 0]] - record.t[0]
        assert np.ptp(np.diff(starts)) < 1e-9 and starts[1] == pytest.approx(0.618, abs=2e-3)
        assert record.duration - starts[-1] < 0.618 + WINDOW / 5


def test_where_simulations_show_no_gap_none_is_left(sound_study):
    """A share of nothing was what rounding had made of it."""
    done, nominal, other = Simulations(sound_study), object(), object()
    done.keep(nominal, Simulated(np.zeros((3, 3))), WINDOW)
    done.keep(other, Simulated(np.full((3, 3), 9.0)), WINDOW)
    assert done.share(nominal, other, ()) == 1.0
    assert not done.tells(nominal, other, ())


@pytest.mark.parametrize(
    ("before", "after", "left"),
    [
        (4.0, 1.05, 0.0),  # no more than a right model
        (4.0, 2.0, 0.4344),
        (1.25, 1.05, 1.0),  # no gap that calls for a cause
    ],
)
def test_what_a_right_model_leaves_beside_the_noise_is_no_gap(sound_study, before, after, left):
    done, nominal, other = Simulations(sound_study), object(), object()
    for fit, floors in ((nominal, before), (other, after)):
        done.keep(fit, Simulated(np.tile((floors * done.floor) ** 2, (20, 1))), WINDOW)
    assert done.share(nominal, other, ()) == pytest.approx(left, abs=1e-3)
    assert done.tells(nominal, other, ()) is (before > 2.0)


@pytest.mark.parametrize(
    ("floors", "force", "shown"),
    [(0.5, 1.0, False), (2.0, 1.0, True), (2.0, 2.0, False)],
    ids=["noise", "simulations alone", "balances too"],
)
def test_a_gap_is_shown_beside_the_noise_and_by_simulations_alone(
    sound_study, floors, force, shown
):
    rows = (np.outer((1.0, 1.0, force), np.ones(64)),)
    used = (np.ones((3, 64), dtype=bool),)
    nominal = FittedModel((), {}, {}, 0.0, rows, rows, used, used, True)
    done, levels = Simulations(sound_study), BalanceLevels(np.ones(3), np.full(3, 100.0))
    noise = [output_noise(sound_study.axis, sound_study.held_out, n) for n in ("p_P", "p_N", "x")]
    floor = 100 * np.array(noise) / signal_stds(sound_study)
    done.keep(nominal, Simulated(np.tile((1 + floors**2) * floor**2, (3, 1))), WINDOW)
    assert done.alone_show_gap(nominal, (), levels) is shown


@pytest.mark.parametrize(
    ("before", "after", "windows", "explained"),
    [
        ((20, 20, 20), (2, 2, 2), 40, True),
        ((20, 20, 20), (9, 9, 9), 40, False),  # too much is left
        ((20, 20, 8), (1, 1, 8), 40, False),  # one output keeps its error
        ((20, 20, 1), (1, 1, 1), 40, True),  # ... unless it is within the noise
        ((1, 1, 1), (0.1, 0.1, 0.1), 40, False),  # there was no visible gap
        ((20, 20, 20), (2, 2, 2), 4, False),  # too few windows for an interval
    ],
)
def test_simulations_are_surely_explained_in_every_output(
    sound_study, before, after, windows, explained
):
    """Sizes are those beside the noise, in floors."""
    done, models = Simulations(sound_study), (object(), object())
    noise = [output_noise(sound_study.axis, sound_study.held_out, n) for n in ("p_P", "p_N", "x")]
    floor = 100 * np.array(noise) / signal_stds(sound_study)
    for model, sizes in zip(models, (before, after), strict=True):
        squares = (1 + np.square(sizes)) * floor**2
        done.keep(model, Simulated(np.tile(squares, (windows, 1))), WINDOW)
    assert done.surely_explained(*models, (), CRITERIA) is explained


def test_what_is_simulated_elsewhere_is_waited_for_once(sound_study):
    done, fitted, job = Simulations(sound_study), object(), Future()
    done.expect(fitted, job)
    assert done.knows(fitted) and not done.knows(fitted, WINDOW / 5)
    job.set_result(Simulated(np.ones((2, 3))))
    assert done.of(fitted, ()) is done.of(fitted, ()) is job.result() and done.knows(fitted)


@pytest.mark.parametrize("fault", [OverflowError, ZeroDivisionError])
def test_an_arithmetic_error_is_a_reason_why_there_is_no_gap(rubbing_study, monkeypatch, fault):
    """It ended a diagnosis whose balances had told all."""
    study, nominal = rubbing_study

    def fail(*given):
        raise fault("out of range")

    monkeypatch.setattr(simulated_fit, "window_runs", fail)
    monkeypatch.setattr(simulated_fit, "loop_errors", fail)
    assert simulate_fit(study, nominal, ()).windows == "out of range"
    assert simulate_loop(study, nominal, ()) == "out of range"
