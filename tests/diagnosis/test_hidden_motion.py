"""Two causes of which one is a sensor that hides the motion, or one mends what the other spoils."""

from concurrent.futures import Future
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.diagnosis.prepare.prepare_study import prepare_study
from pneumo_casadi.diagnosis.select import (
    by_simulation,
    hidden_motion,
    refined_trials,
)
from pneumo_casadi.diagnosis.select.complete import Completed
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger
from pneumo_casadi.diagnosis.select.forward_selection import _coarse
from pneumo_casadi.diagnosis.select.hidden_motion import _candidates, motion_is_hidden
from pneumo_casadi.diagnosis.select.refined_trials import refine_again
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import FitError


@dataclass(frozen=True)
class SimpleFit:
    effects: tuple[str, ...]
    values: dict[str, float]
    cost: float = 0.0


def fitted(study, *names, nominal=None):
    values = None if nominal is None else nominal.values
    return fit_model(study, [EFFECTS[name]() for name in names], values)


@pytest.mark.slow
def test_the_balances_show_beside_a_late_sensor_the_leak_that_it_hides_alone(made_case):
    """Simulations tell it then; `benchmarks/rule_cases.py` diagnoses this case."""
    study, _ = prepare_study(made_case(22, 2.0, position_delay="large", leakage_P="large"))
    names = ("leakage_P", "position_delay")
    nominal = fitted(study)
    alone = {name: fitted(study, name, nominal=nominal) for name in names}
    both = fitted(study, *names, nominal=alone["position_delay"])
    assert motion_is_hidden((EFFECTS["position_delay"](),), alone["position_delay"])
    gained = nominal.cost - alone["leakage_P"].cost, alone["position_delay"].cost - both.cost
    assert gained[1] > 2 * gained[0]
    assert gained[1] > 5 * CRITERIA.form_gain


@pytest.mark.parametrize(("cost", "tried"), [(-50.0, True), (-5.0, False), (50.0, False)])
def test_a_second_sensor_is_tried_where_it_gains_in_fits(cost, tried):
    """The first one may stand for it too: alone it is no reason to simulate both."""
    costs = {("position_delay",): 0.0, ("backlash",): 100.0, ("backlash", "position_delay"): cost}
    costs |= {(name, "position_delay"): 0.0 for name in ("hose", "stribeck", "elastic_load")}
    worker = FitLedger(SimpleNamespace(criteria=CRITERIA), EFFECTS)
    worker.fits = {worker.key(key): SimpleNamespace(cost=value) for key, value in costs.items()}
    assert ("backlash" in _candidates(worker, ("position_delay",))) is tried


def test_where_both_refinements_fail_their_reason_stays(monkeypatch):
    names, start = ("backlash", "presliding"), SimpleNamespace(values={})
    worker = FitLedger(SimpleNamespace(criteria=CRITERIA), EFFECTS)
    worker.trials[names] = start, np.inf
    failed = Future()
    failed.set_exception(FitError("ran away"))
    monkeypatch.setattr(worker, "run", lambda *given: failed)
    refine_again(worker, None, {names: start})
    assert worker.trials[names][1] == np.inf
    assert "ran away" in worker.failures[names].reason
    refine_again(worker, None, {})


def test_a_second_refinement_that_fails_leaves_the_first_and_no_failure(monkeypatch):
    names, first = ("backlash", "presliding"), SimpleNamespace(values={})
    worker = FitLedger(SimpleNamespace(criteria=CRITERIA), EFFECTS)
    worker.trials[names] = first, 0.2
    failed = Future()
    failed.set_exception(FitError("ran away"))
    monkeypatch.setattr(worker, "run", lambda *given: failed)
    refine_again(worker, None, {names: first})
    assert worker.trials[names] == (first, 0.2)
    assert not worker.failures


@pytest.mark.parametrize(
    ("excess", "known", "names", "expected"),
    [
        (1.7, (), ("flow_map_shape",), True),
        (2.1, (), ("flow_map_shape",), False),
        (1.7, (), ("valve_dead_zone",), True),
        (2.1, (), ("valve_dead_zone",), False),
        (1.7, (), ("valve_hysteresis",), False),  # no static map
        (1.7, ("spring_load",), ("flow_map_shape", "spring_load"), True),
        (2.1, ("spring_load",), ("flow_map_shape", "spring_load"), False),
        (1.7, ("spring_load",), ("spring_load", "valve_dead_zone"), False),
        (1.7, ("spring_load",), ("flow_map_shape", "stribeck"), False),  # no map alone
    ],
)
def test_a_coarse_map_is_no_shape_of_the_valve(excess, known, names, expected):
    residuals = (np.array([[1.0], [excess], [1.0]]),)
    current = SimpleNamespace(held_out=residuals, used_held_out=(np.ones((3, 1), bool),))
    worker = SimpleNamespace(effects=lambda names: tuple(EFFECTS[n]() for n in names))
    by = BalanceLevels(np.ones(3), np.ones(3))
    assert _coarse(worker, current, known, names, by) is expected


@pytest.mark.parametrize(
    ("name", "values", "hidden"),
    [
        ("position_delay", {"T": 0.7e-3}, False),  # taken back within 60 Hz
        ("position_delay", {"T": 12e-3}, True),
        ("backlash", {"gap": 1e-4}, True),
        ("pressure_sensor_lag", {"tau": 10e-3}, False),
    ],
)
def test_a_short_delay_hides_no_motion(name, values, hidden):
    effect = EFFECTS[name]()
    own = {item.name: values.get(item.name, item.value) for item in effect.parameters}
    fitted = SimpleNamespace(values={f"{name}.{key}": value for key, value in own.items()})
    assert motion_is_hidden((effect,), fitted) is hidden


@pytest.mark.parametrize(("again", "needed"), [(0.5, True), (0.2, False), (0.28, False)])
def test_an_effect_that_only_led_out_of_a_local_minimum_is_not_needed(monkeypatch, again, needed):
    """The smaller model begins where the larger one ended; 0.2 of the gap is what that left."""
    known, names = ("backlash",), ("backlash", "stribeck")
    ended = SimpleFit(
        ("backlash", "stribeck"), {"M": 2.0, "backlash.gap": 1e-3, "stribeck.delta_F": 1}
    )
    worker = FitLedger(SimpleNamespace(criteria=CRITERIA), EFFECTS)
    worker.trials = {known: (None, 0.6), names: (ended, 0.2)}

    def refined(ledger, nominal, starts, iterations):
        ((key, start),) = starts.items()
        assert key == known
        assert start.values == {"M": 2.0, "backlash.gap": 1e-3}
        ledger.trials[key] = start, again

    monkeypatch.setattr(refined_trials, "refine_all", refined)
    assert hidden_motion._is_needed(worker, None, known, names) is needed
    assert worker.trials[known][1] == again


PLAY, BOTH = ("backlash",), ("backlash", "valve_null_shift")


@pytest.fixture
def simulated(made):
    """A play that output error has refined, which leaves 0.6 of the gap, and a null beside it."""
    axis = made.true_axis()
    worker = FitLedger(SimpleNamespace(criteria=CRITERIA, axis=axis), EFFECTS)
    balances = axis.parameters.as_dict() | {"backlash.gap": 6e-4}
    shifted = {"M": 3.0, "valve_null_shift.u_0P": 0.1, "valve_null_shift.u_0N": 0.2}
    worker.fits = {
        PLAY: SimpleFit(PLAY, balances, -500.0),
        BOTH: SimpleFit(BOTH, balances | shifted, -600.0),
    }
    refined = SimpleFit(PLAY, balances | {"M": 2.0, "backlash.gap": 1.4e-3}, -500.0)
    worker.trials, worker.gap_left = {PLAY: (refined, 0.6)}, {PLAY: 0.6}
    return worker


def test_output_error_goes_on_from_what_it_has_made_of_the_smaller_model(simulated, monkeypatch):
    """The balances see half of a play: from their fit, twelve iterations did not bring it back."""
    monkeypatch.setattr(simulated, "simulations", SimpleNamespace(share=lambda *given: 0.9))
    begin = hidden_motion.beside(simulated, None, PLAY, ("valve_null_shift",))
    assert begin.effects == BOTH
    expected = {"M": 2.0, "backlash.gap": 1.4e-3, "valve_null_shift.u_0P": 0.1}
    assert {name: begin.values[name] for name in expected} == expected

    simulated.fits[BOTH] = replace(simulated.fits[BOTH], cost=-510.0)  # gains too little
    begin = hidden_motion.beside(simulated, None, PLAY, ("valve_null_shift",))
    assert begin.values["M"] == 2.0 and begin.values["valve_null_shift.u_0P"] != 0.1


@pytest.mark.parametrize(
    ("at_first", "again", "left"),
    [(1.8, True, 0.3), (np.inf, True, 0.3), (0.64, False, None), (0.3, False, 0.3)],
)
def test_a_larger_model_that_leaves_more_begins_again_with_the_smaller_one(
    simulated, monkeypatch, at_first, again, left
):
    """From where the balances had friction over pressure, output error ran away."""
    starts = []

    def refine_all(ledger, nominal, models, iterations=0):
        for key, start in models.items():
            if key == BOTH and BOTH not in ledger.trials:
                starts.append(start)
                ledger.trials[key] = start, at_first if len(starts) == 1 else 0.3

    for module in (hidden_motion, refined_trials):
        monkeypatch.setattr(module, "refine_all", refine_all)
    monkeypatch.setattr(simulated, "simulations", SimpleNamespace(leave_gap=lambda *given: True))
    monkeypatch.setattr(hidden_motion, "fit_extensions", lambda *given: None)
    monkeypatch.setattr(hidden_motion, "_candidates", lambda *given: ["valve_null_shift"])
    monkeypatch.setattr(hidden_motion, "beside", lambda *given: simulated.fits[BOTH])
    monkeypatch.setattr(hidden_motion, "_is_needed", lambda *given: True)
    levels = SimpleNamespace(criteria=CRITERIA)
    better = hidden_motion._extended(simulated, None, PLAY, levels)
    assert better == (BOTH if left else None)
    assert starts[0] is simulated.fits[BOTH]
    assert any(start.values["M"] == 2.0 for start in starts) is again
    if left:
        assert simulated.trials[BOTH][1] == left


def test_where_nothing_is_left_that_calls_for_a_cause_no_other_effect_is_tried(
    simulated, monkeypatch
):
    """Of a play's rest, 0.4 noise floors, Stribeck friction that was not there left a sixth."""
    monkeypatch.setattr(hidden_motion, "refine_all", lambda *given: None)
    monkeypatch.setattr(simulated, "simulations", SimpleNamespace(leave_gap=lambda *given: False))
    monkeypatch.delattr(hidden_motion, "fit_extensions")
    levels = SimpleNamespace(criteria=CRITERIA)
    assert hidden_motion._extended(simulated, None, PLAY, levels) is None


def test_it_begins_with_the_balances_where_their_smaller_model_leaves_less(simulated, monkeypatch):
    monkeypatch.setattr(simulated, "simulations", SimpleNamespace(share=lambda *given: 0.5))
    begin = hidden_motion.beside(simulated, None, PLAY, ("valve_null_shift",))
    assert begin is simulated.fits[BOTH]


@pytest.mark.parametrize(
    ("left", "asked", "after", "taken"),
    [
        (0.6, BOTH, 0.3, True),
        (0.6, BOTH, 0.37, False),  # explains nothing
        (0.4, BOTH, 0.3, False),  # leaves three quarters of what the play leaves
        (0.6, PLAY, 0.3, False),  # the balances ask for nothing more
        (0.6, ("valve_null_shift",), 0.3, False),  # or for something else
    ],
)
def test_weak_effects_beside_a_play_are_judged_together(
    simulated, monkeypatch, left, asked, after, taken
):
    """None of four closed enough alone, and a play that was there was `unknown`."""
    refined = SimpleNamespace(values={})
    simulated.gap_left[PLAY] = left

    def find_acting(ledger, nominal, final, levels, useful):
        assert useful((*PLAY, "stribeck")) and not useful(("stribeck",))
        return asked

    monkeypatch.setattr(by_simulation, "find_acting", find_acting)
    monkeypatch.setattr(by_simulation, "beside", lambda *given: None)
    monkeypatch.setattr(
        by_simulation,
        "refine_all",
        lambda ledger, nominal, starts: ledger.trials.update({BOTH: (refined, after)}),
    )
    levels = SimpleNamespace(criteria=CRITERIA)
    done = by_simulation.complete_by_simulation(simulated, None, PLAY, levels)
    assert done == Completed(BOTH if taken else PLAY, PLAY)
    assert (simulated.output_error_fits.get(BOTH) is refined) is taken


def test_what_explains_the_gap_alone_is_not_completed(simulated, monkeypatch):
    simulated.gap_left[PLAY] = 0.3
    monkeypatch.delattr(by_simulation, "find_acting")
    done = by_simulation.complete_by_simulation(
        simulated, None, PLAY, SimpleNamespace(criteria=CRITERIA)
    )
    assert done == Completed(PLAY, PLAY)


@pytest.mark.parametrize(
    ("alone", "both", "smaller"),
    [
        (0.43, 0.48, True),
        (0.50, 0.48, False),
        (0.30, np.inf, True),  # what could not be refined is no better
        (1.20, np.inf, False),
        (np.inf, np.inf, False),
    ],
)
def test_a_smaller_model_is_taken_where_it_leaves_no_more(monkeypatch, alone, both, smaller):
    first, names = ("backlash",), ("backlash", "elastic_load")
    worker = FitLedger(SimpleNamespace(criteria=CRITERIA), EFFECTS)
    worker.fits = {key: SimpleFit(key, {"backlash.gap": 1e-3}) for key in (first, names)}
    worker.trials = {first: (worker.fits[first], alone), names: (worker.fits[names], both)}
    taken = []
    monkeypatch.setattr(worker, "take", taken.append)
    for name, answer in {"refine_all": None, "_is_needed": False, "_extended": None}.items():
        monkeypatch.setattr(hidden_motion, name, lambda *given, answer=answer: answer)
    monkeypatch.setattr(hidden_motion, "_take_refined", lambda ledger, nominal, key: None)
    path = hidden_motion.extend_by_simulation(worker, None, (first, names), None, 6)
    assert path == ((first,) if smaller else (first, names))
    assert taken == ([first] if smaller else [])
