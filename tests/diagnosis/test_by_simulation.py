"""An effect that simulations alone show."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis.decide.judgement import judge
from pneumo_casadi.diagnosis.decide.what_is_left import decided_by_simulation
from pneumo_casadi.diagnosis.metrics.findings import Closure
from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.diagnosis.metrics.verdict import Verdict
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select import by_simulation
from pneumo_casadi.diagnosis.select.by_simulation import find_in_simulation
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger
from pneumo_casadi.diagnosis.select.selection import Selection
from pneumo_casadi.effects import EFFECTS

LEVELS = BalanceLevels(np.ones(3), np.full(3, 100.0))


@dataclass(frozen=True)
class SimpleFit:
    effects: tuple[str, ...]
    cost: float = 0.0
    values: Mapping[str, float] = field(default_factory=dict)


def leaving(force, cost=0.0):
    """A fit with this residual of the force, in noise floors."""
    rows = (np.outer((1.0, 1.0, force), np.ones(64)),)
    used = (np.ones((3, 64), dtype=bool),)
    return FittedModel((), {}, {}, cost, rows, rows, used, used, True)


@pytest.fixture
def search(monkeypatch):
    """Return a search: shares left as fitted alone, and once refined; what was refined."""

    def searched(alone, refined, *, shown=True, lower=0.5, left_out=(), beside=None, remaining=1.0):
        worker = FitLedger(SimpleNamespace(criteria=CRITERIA), EFFECTS)
        worker.fits = {(name,): SimpleFit((name,)) for name in alone if name not in left_out}
        worker.left_out = set(left_out)
        worker.simulations = SimpleNamespace(
            alone_show_gap=lambda fitted, effects, levels: shown and remaining == 1.0,
            share=lambda nominal, fit, effects: (alone | (beside or {}))[fit.effects[0]],
            closure=lambda base, fit, effects, of_base: Closure(1 - lower / 2, lower, 1.0),
        )
        tried = []

        def refine_all(ledger, nominal, starts):
            tried.extend(starts)
            for names, start in starts.items():
                ledger.trials[names] = start, refined[names[-1]]

        monkeypatch.setattr(worker, "begin_simulations", lambda fits: None)
        monkeypatch.setattr(
            worker, "fit_all", lambda starts: worker.fits.update({k: SimpleFit(k) for k in starts})
        )
        monkeypatch.setattr(by_simulation, "refine_all", refine_all)
        known = tuple(beside or ())
        if known:
            worker.fits[known] = replace(leaving(remaining), effects=known)
        return find_in_simulation(worker, leaving(1.0), known, LEVELS), tried, worker

    return searched


def test_what_simulations_alone_show_is_explained_by_them(search):
    names, tried, worker = search({"presliding": 0.43, "stribeck": 0.98}, {"presliding": 0.41})
    assert names == ("presliding",) and tried == [("presliding",)]
    assert worker.gap_left == {names: 0.41} and names in worker.output_error_fits
    assert worker.by_simulation


@pytest.mark.parametrize("other", [{"shown": False}, {"lower": 0.2}], ids=["no gap", "chance"])
def test_else_nothing_is_named(search, other):
    names, _, worker = search({"presliding": 0.43}, {"presliding": 0.41}, **other)
    assert names is None and not worker.by_simulation and not worker.output_error_fits


def test_a_share_is_judged_once_it_is_refined_and_rivals_are_refined_too(search):
    alone = {"presliding": 0.52, "stribeck": 0.6, "elastic_load": 0.9}
    names, tried, _ = search(alone, {"presliding": 0.48, "stribeck": 0.2})
    assert names == ("stribeck",) and tried == [("presliding",), ("stribeck",)]
    names, _, worker = search(alone, {"presliding": 0.53, "stribeck": 0.55})
    assert names is None and not worker.by_simulation


def test_the_balances_have_not_chosen_the_form(search):
    alone = {"presliding": 0.66, "presliding_dahl": 0.12, "presliding_maxwell": 0.7}
    names, _, worker = search(
        alone,
        {"presliding": 0.58, "presliding_dahl": 0.11, "presliding_maxwell": 0.6},
        left_out=("presliding_dahl", "presliding_maxwell"),
    )
    assert names == ("presliding_dahl",)
    assert {"presliding", "presliding_maxwell"} <= worker.left_out
    assert "presliding_dahl" not in worker.left_out
    assert list(worker.trials) == [names]  # another form of a cause is no rival of it


def test_what_corrects_a_map_is_not_simulated(search):
    names, tried, _ = search({"valve_null_shift": 0.1, "flow_map_shape": 0.1}, {})
    assert names is None and not tried


def test_what_weak_effects_leave_in_simulation_is_explained_beside_them(search):
    """The balances, of the motion that was measured, show next to nothing of a breakaway."""
    weak = {"pressure_sensor_bias": 0.98}
    names, tried, worker = search(
        {"stribeck": 0.5, "presliding": 0.9}, {"stribeck": 0.1}, beside=weak
    )
    assert names == ("pressure_sensor_bias", "stribeck") and tried == [names]
    assert worker.by_simulation and worker.gap_left == {names: 0.1}


@pytest.mark.parametrize(
    "other",
    [
        {"beside": {"pressure_sensor_bias": 0.4}},
        {"beside": {"pressure_sensor_bias": 0.52}, "refined": 0.49},
        {"remaining": 2.0},
        {"shown": False},
    ],
    ids=["explained", "no better", "balances open", "no gap"],
)
def test_where_weak_effects_explain_it_or_balances_tell_nothing_is_added(search, other):
    given = {"beside": {"pressure_sensor_bias": 0.98}, **other}
    refined = {"stribeck": given.pop("refined", 0.1)}
    names, tried, worker = search({"stribeck": 0.5}, refined, **given)
    assert names is None and not worker.by_simulation
    assert bool(tried) == ("refined" in other)


def selected(left, force=1.0):
    names = ("presliding",)
    fit = leaving(force, -10.0)
    return Selection(
        leaving(force),
        {names: fit},
        (),
        {},
        (names,),
        LEVELS,
        {names: fit},
        {names: left},
        {names: left},
        None,
        contributions={"presliding": 1 - left},
        by_simulation=True,
    )


@pytest.mark.parametrize(("left", "probability"), [(0.02, 0.94), (0.45, 0.75)])
def test_what_is_left_in_simulation_lowers_the_probability(left, probability):
    judged = judge(selected(left), (EFFECTS["presliding"](),))
    assert judged.verdict is Verdict.EFFECT and judged.unexplained == left
    assert judged.probability["presliding",] == pytest.approx(probability)


def test_an_effect_that_the_balances_show_is_judged_by_them():
    chosen = replace(selected(0.45), by_simulation=False)
    assert decided_by_simulation(selected(0.45)) and not decided_by_simulation(chosen)
