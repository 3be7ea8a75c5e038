"""Several forms of one cause: the best stands for it, and the verdict names the cause."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis.metrics.residual_size import (
    BalanceLevels,
    balance_closure,
    balance_levels,
    residual_rms,
)
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA, in_floors
from pneumo_casadi.diagnosis.prepare.fitted_model import _without, fit_model
from pneumo_casadi.diagnosis.prepare.prepare_study import prepare_study
from pneumo_casadi.diagnosis.screen.screen import ScreenResult
from pneumo_casadi.diagnosis.select import forms as stage
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Start
from pneumo_casadi.diagnosis.select.forms import (
    begin_waiting_forms,
    cause_of,
    causes_of,
    fit_forms_of_leading_causes,
    fit_remaining_forms,
    forms_to_fit,
    keep_best_forms,
    with_other_form,
)
from pneumo_casadi.effects import EFFECTS

#: Rows of the records fitted, and of those held out.
ROWS = 100


def gaining(both, held_out=None):
    """A fit that gains `both` on all records: half of it, or `held_out`, on those held out."""
    share = both / 2 if held_out is None else held_out
    rms = {True: np.exp(-share / ROWS), False: np.exp(-(both - share) / ROWS)}
    parts = {held: (np.full((1, ROWS), value),) for held, value in rms.items()}
    used = (np.ones((1, ROWS)),)
    return SimpleNamespace(
        train=parts[False], held_out=parts[True], used_train=used, used_held_out=used
    )


@pytest.fixture
def ledger(monkeypatch):
    """A ledger of single fits with made-up gains; nothing is fitted."""
    monkeypatch.setattr(FitLedger, "__post_init__", lambda self: None)
    names = ("hose", "hose_volume", "stribeck", "elastic_load", "position_on_elastic_load")
    made = FitLedger(SimpleNamespace(criteria=CRITERIA), {name: EFFECTS[name] for name in names})
    made.fits.update({(n,): gaining(g) for n, g in zip(names, (50, 97, 96, 99, 98), strict=True)})
    made.directions.update(dict.fromkeys(names, ()))
    return made


def test_the_form_that_gains_most_stands_for_its_cause(ledger):
    forms = keep_best_forms(ledger, gaining(0))
    assert {cause: set(fits) for cause, fits in forms.items()} == {
        "hose": {"hose", "hose_volume"},
        "elastic_load": {"elastic_load", "position_on_elastic_load"},
    }
    assert set(ledger.fits) == {("hose_volume",), ("stribeck",), ("elastic_load",)}
    assert set(ledger.offered) == {"hose_volume", "stribeck", "elastic_load"}
    assert ledger.left_out == {"hose", "position_on_elastic_load"}


@pytest.mark.parametrize(("held_out", "kept"), [(25.0, "hose_volume"), (-25.0, "hose")])
def test_what_a_form_gains_on_records_held_out_counts_as_well(ledger, held_out, kept):
    ledger.fits["hose",] = gaining(50)
    ledger.fits["hose_volume",] = gaining(90 + held_out, held_out)
    keep_best_forms(ledger, gaining(0))
    assert (kept,) in ledger.fits


@pytest.mark.parametrize(("better_by", "kept"), [(19.0, "hose"), (21.0, "hose_volume")])
def test_a_form_with_more_parameters_must_earn_them(ledger, better_by, kept):
    assert CRITERIA.form_gain == 20.0
    ledger.fits["hose_volume",] = gaining(50 + better_by)
    keep_best_forms(ledger, gaining(0))
    assert (kept,) in ledger.fits


def test_a_form_that_failed_is_no_rival(ledger):
    ledger.failures["hose_volume",] = ledger.fits.pop(("hose_volume",))
    keep_best_forms(ledger, gaining(0))
    assert ("hose",) in ledger.fits and "hose_volume" in ledger.left_out
    assert ("hose_volume",) not in ledger.failures


def test_where_all_forms_failed_their_reasons_stay(ledger):
    for name in ("hose", "hose_volume"):
        ledger.failures[name,] = ledger.fits.pop((name,))
    assert "hose" not in keep_best_forms(ledger, gaining(0))
    assert set(ledger.failures) == {("hose",), ("hose_volume",)}


def test_a_cause_is_told_once():
    names = ("hose_volume", "stribeck", "hose", "of your own")
    assert causes_of(names, EFFECTS) == ("hose", "stribeck", "of your own")
    assert cause_of("position_on_elastic_load", EFFECTS) == "elastic_load"


def promises(names, **explained):
    """What the screen says of effects that are all felt: the share of the residuals explained."""
    return {
        name: ScreenResult(name, explained.get(name, 0.0), 0.0, np.zeros(3), 1.0, True, ({},), {})
        for name in names
    }


def test_a_further_form_that_promises_nothing_is_not_fitted(ledger):
    usual = {"hose", "stribeck", "elastic_load"}
    # The start of an elastic load is scanned: its screen says little.
    screened = promises(ledger.catalogue)
    assert set(forms_to_fit(ledger, screened)) == usual | {"position_on_elastic_load"}
    assert "hose_volume" in forms_to_fit(ledger, promises(ledger.catalogue, hose_volume=0.3))


@pytest.mark.parametrize(("explained", "fitted"), [(0.305, False), (0.32, True)])
def test_a_form_that_contains_another_one_must_promise_more_than_that(explained, fitted):
    names = ("hose", "hose_volume", "hose_volume_per_chamber")
    ledger = FitLedger(SimpleNamespace(criteria=CRITERIA), {n: EFFECTS[n] for n in names})
    screened = promises(names, hose_volume=0.3, hose_volume_per_chamber=explained)
    assert ("hose_volume_per_chamber" in forms_to_fit(ledger, screened)) is fitted


@pytest.mark.parametrize(
    ("explained", "left", "tried"),
    [
        ({}, 8.0, ["stribeck_rational"]),
        ({"presliding_dahl": 0.02}, 8.0, ["presliding_dahl", "stribeck_rational"]),
        # A spool that sticks is not felt where it sticks little: its cause's usual form tells.
        ({"valve_hysteresis": 0.02}, 8.0, ["valve_stiction", "stribeck_rational"]),
        # It must promise more than the form that it contains, though that one is offered already.
        ({"valve_dead_zone": 0.3, "valve_dead_zone_per_edge": 0.3}, 8.0, ["stribeck_rational"]),
        (
            {"valve_dead_zone": 0.3, "valve_dead_zone_per_edge": 0.4},
            8.0,
            ["stribeck_rational", "valve_dead_zone_per_edge"],
        ),
        ({"presliding_dahl": 0.02}, 2.0, ["stribeck_rational"]),
    ],
    ids=["nothing", "a form", "its usual form", "as much", "more", "not too much is left"],
)
def test_forms_of_causes_that_a_model_lacks_are_tried_where_they_promise_something(
    monkeypatch, explained, left, tried
):
    monkeypatch.setattr(FitLedger, "__post_init__", lambda self: None)
    names = ("stribeck", "stribeck_rational", "presliding", "presliding_dahl")
    valve = ("valve_dead_zone", "valve_dead_zone_per_edge", "valve_hysteresis", "valve_stiction")
    ledger = FitLedger(
        SimpleNamespace(criteria=CRITERIA), {name: EFFECTS[name] for name in (*names, *valve)}
    )
    ledger.directions.update(dict.fromkeys(ledger.catalogue, ()))
    ledger.left_out = {
        "stribeck_rational",
        "presliding_dahl",
        "valve_dead_zone_per_edge",
        "valve_stiction",
    }
    known = ("stribeck",)
    ledger.fits[known] = leaving(left)
    monkeypatch.setattr(stage, "background", lambda *given: None)
    monkeypatch.setattr(
        FitLedger, "screen", lambda self, behind, names: promises(names, **explained)
    )
    asked = []
    monkeypatch.setattr(FitLedger, "fit_all", lambda self, starts: asked.extend(starts))
    levels = BalanceLevels(np.ones(1), np.full(1, 100.0))
    with_other_form(ledger, leaving(10.0), known, levels)
    assert [name for key in asked for name in key if name in ledger.left_out] == tried


def leaving(rms):
    """A fit that leaves a residual [noise floors] on all records."""
    return SimpleNamespace(values={}, **vars(gaining(-2 * ROWS * np.log(rms))))


@pytest.mark.parametrize(
    ("left", "other", "besides", "expected"),
    [
        (2.0, 1.6, 1.0, ("hose", "stribeck")),
        (2.0, 1.95, 1.0, ("hose_volume", "stribeck")),  # gains five, a form must gain twenty
        (1.4, 1.0, 1.0, ("hose_volume", "stribeck")),  # no gap that would be visible is left
        # A further cause may join only where too much is left, and must close much of it.
        (8.0, 7.9, 2.0, ("hose_volume", "stribeck", "position_on_elastic_load")),
        (8.0, 7.9, 6.0, ("hose_volume", "stribeck")),
    ],
)
def test_beside_others_another_form_stands_for_its_cause_where_it_fits_all_records_better(
    ledger, monkeypatch, left, other, besides, expected
):
    known, swapped = ("hose_volume", "stribeck"), ("hose", "stribeck")
    further = (*known, "position_on_elastic_load")
    results = {swapped: leaving(other), further: leaving(besides)}
    monkeypatch.setattr(
        FitLedger, "fit_all", lambda self, keys: self.fits.update({k: results[k] for k in keys})
    )
    monkeypatch.setattr(FitLedger, "refine", lambda self, names: None)
    monkeypatch.setattr(stage, "background", lambda *given: None)
    monkeypatch.setattr(FitLedger, "screen", lambda self, behind, names: promises(names))
    keep_best_forms(ledger, gaining(0))
    ledger.fits[known] = leaving(left)
    levels = BalanceLevels(np.ones(1), np.full(1, 100.0))
    assert with_other_form(ledger, leaving(10.0), known, levels) == expected
    assert expected in ledger.fits
    assert len({known, swapped} & set(ledger.fits)) == 1  # forms of one cause are no rivals
    # Of each cause one form is offered: the one that the model has.
    assert {"hose", "hose_volume"} & set(ledger.offered) == (
        {"hose"} if expected == swapped else {"hose_volume"}
    )
    assert {"elastic_load", "position_on_elastic_load"} & set(ledger.offered) == (
        {"position_on_elastic_load"} if expected == further else {"elastic_load"}
    )


def test_another_form_takes_the_place_of_the_only_effect_of_a_model(ledger, monkeypatch):
    """From where the first one has been refined, it may fit better than alone from its start."""
    monkeypatch.setattr(
        FitLedger, "fit_all", lambda self, keys: self.fits.update({("hose",): leaving(1.6)})
    )
    monkeypatch.setattr(FitLedger, "refine", lambda self, names: None)
    keep_best_forms(ledger, gaining(0))
    ledger.fits["hose_volume",] = leaving(2.0)
    levels = BalanceLevels(np.ones(1), np.full(1, 100.0))
    assert with_other_form(ledger, leaving(10.0), ("hose_volume",), levels) == ("hose",)
    assert ("hose_volume",) not in ledger.fits and "hose_volume" in ledger.left_out


def test_before_a_gap_is_unknown_the_forms_not_tried_so_far_are_fitted(ledger, monkeypatch):
    """One that gains much stands for its cause then; what was tried is not fitted again."""
    asked = {}

    def fit_all(self, starts):
        asked.update(starts)
        self.fits["hose_volume",] = gaining(300)

    monkeypatch.setattr(FitLedger, "fit_all", fit_all)
    del ledger.fits["hose_volume",]
    nominal = SimpleNamespace(**vars(gaining(0)), values={})
    tried = set(ledger.catalogue) - {"hose_volume"}
    keep_best_forms(ledger, nominal)
    shapes = ({"hose_volume.C": 1e-9}, {"hose_volume.C": 4e-9})
    promised = replace(promises(["hose_volume"])["hose_volume"], starts=shapes)
    more = fit_remaining_forms(ledger, nominal, {"hose_volume": promised}, tried)
    assert asked == {("hose_volume",): Start({}, shapes)}
    assert set(more["hose"]) == {"hose", "hose_volume"}
    assert "hose_volume" in ledger.offered and "hose" in ledger.left_out
    assert fit_remaining_forms(ledger, nominal, {}, ledger.catalogue) == {}


@pytest.mark.parametrize(
    ("over_guided", "kept"),
    [(19.0, "position_on_guided_load"), (21.0, "position_on_progressive_load")],
)
def test_a_form_earns_the_parameters_that_it_has_beyond_the_one_it_contains(over_guided, kept):
    """Fits of nested forms end within rounding of each other, and the largest would be told."""
    names = ("elastic_load", "position_on_elastic_load")
    names += ("position_on_guided_load", "position_on_progressive_load")
    ledger = FitLedger(SimpleNamespace(criteria=CRITERIA), {n: EFFECTS[n] for n in names})
    gains = (50.0, 100.0, 121.0, 121.0 + over_guided)
    ledger.fits.update({(n,): gaining(g) for n, g in zip(names, gains, strict=True)})
    keep_best_forms(ledger, gaining(0))
    assert set(ledger.fits) == {(kept,)}


@pytest.mark.parametrize(
    ("usual", "left", "fitted"),
    [(200, 9.0, True), (200, 1.0, False), (60, 9.0, False)],
    ids=["leaves a gap", "leaves none", "closes little"],
)
def test_a_form_not_tried_is_fitted_where_the_usual_one_closes_much_and_leaves_a_gap(
    ledger, monkeypatch, usual, left, fitted
):
    batches = []
    monkeypatch.setattr(FitLedger, "fit_all", lambda self, starts: batches.append(starts))
    forms = ("quadratic_drag", "quadratic_drag_per_direction", "valve_hysteresis", "valve_stiction")
    names = ("stribeck", "stribeck_film", "stribeck_rational", *forms)
    ledger.catalogue = {name: EFFECTS[name] for name in names}
    nominal = SimpleNamespace(cost=1000.0, values={"M": 2.0})
    ledger.fits.clear()
    ledger.failures = {("stribeck_film",): "not credible"}
    gains = {"stribeck": 300, "valve_hysteresis": usual, "quadratic_drag": usual}
    for name, gain in gains.items():
        rms = 9.0 if name == "stribeck" else left
        ledger.fits[name,] = SimpleNamespace(
            cost=nominal.cost - gain,
            held_out=(np.full((1, ROWS), rms),),
            used_held_out=(np.ones((1, ROWS)),),
        )
    levels = BalanceLevels(np.ones(1), np.full(1, 100.0))
    shapes = ({"quadratic_drag_per_direction.c_plus": 40.0},)
    screened = {
        name: ScreenResult(name, 0.0, 0.0, np.zeros(3), 1.0, True, shapes, {}) for name in names
    }
    fit_forms_of_leading_causes(ledger, nominal, screened, levels)
    stairs, others = batches  # one cuts short only what is as quick
    # As `begin_waiting_forms` begins it, and as `fit_alone` begins the others.
    assert stairs == ({("valve_stiction",): Start(nominal.values)} if fitted else {})
    drag = {("quadratic_drag_per_direction",): Start(nominal.values, shapes)} if fitted else {}
    rational = {("stribeck_rational",): Start(nominal.values, shapes)}  # its cause leaves a gap
    assert others == drag | rational


@pytest.mark.parametrize(("promised", "early"), [(60.0, True), (40.0, False)])
def test_a_form_with_stairs_begins_early_where_the_screen_promises_much_of_its_cause(
    ledger, monkeypatch, promised, early
):
    begun = {}
    monkeypatch.setattr(FitLedger, "begin_fit", lambda self, key, start: begun.update({key: start}))
    gains = {"stribeck": 100.0, "valve_hysteresis": promised, "valve_stiction": 0.0}
    ledger.catalogue = {name: EFFECTS[name] for name in gains}
    screened = {
        name: ScreenResult(name, 0.0, gain, np.zeros(3), 1.0, True, ({},), {})
        for name, gain in gains.items()
    }
    nominal = SimpleNamespace(values={"M": 2.0})
    begin_waiting_forms(ledger, nominal, screened)
    # It begins as `fit_forms_of_leading_causes` asks for it, and counts only there.
    assert begun == ({("valve_stiction",): Start(nominal.values)} if early else {})
    assert "valve_stiction" not in forms_to_fit(ledger, screened)


@pytest.mark.slow
def test_what_another_valve_N_leaves_is_what_its_edges_differ_by(made_case):
    """The bench's valve N differs by 0.8 as much at its exhaust edge as at its supply edge."""
    study, _ = prepare_study(made_case(12, valve_mismatch="large"))
    nominal, levels = fit_model(study, ()), balance_levels(study)
    edges = fit_model(study, (EFFECTS["valve_mismatch_edges"](),), nominal.values)
    left = (residual_rms(fitted)[1] / levels.noise[1] for fitted in (nominal, edges))
    before, after = left
    assert before > 4.0 and after < in_floors(levels.criteria.clean)
    assert abs(edges.values["valve_mismatch_edges.delta"]) == pytest.approx(0.05, abs=0.02)


@pytest.mark.slow
def test_a_dead_zone_of_other_edges_is_told_by_its_form_and_its_gap_closes(made_case):
    """A shifted null beside an even zone opens the valve within it, which uneven edges do not.

    `benchmarks/rule_cases.py` diagnoses such a case.
    """
    study, _ = prepare_study(made_case(12, valve_dead_zone_uneven="large"))
    nominal, name = fit_model(study, ()), "valve_dead_zone_edges"
    ledger = FitLedger(study, {each: EFFECTS[each] for each in ("valve_dead_zone", name)})
    for each in ledger.catalogue:
        ledger.fits[each,] = fit_model(study, (EFFECTS[each](),), nominal.values)
    keep_best_forms(ledger, nominal)
    ((kept, uneven),) = ledger.fits.items()
    assert kept == (name,)
    shifted = [EFFECTS[each]() for each in ("valve_dead_zone", "valve_null_shift")]
    assert uneven.cost < fit_model(study, shifted, nominal.values).cost - CRITERIA.form_gain
    assert balance_closure(nominal, uneven, balance_levels(study)).value > 0.94
    for short, value in {"delta": 0.1612, "e": 0.5}.items():
        assert uneven.values[f"{name}.{short}"] == pytest.approx(value, rel=0.02)


@pytest.mark.slow
def test_a_restriction_that_is_felt_only_when_large_is_found(made_case):
    """Among the starts that are tried, and from a small one by the internal leakage beside it."""
    study, _ = prepare_study(made_case(187478258570, 20.0, exhaust_restriction="large"))
    nominal, effects = fit_model(study, ()), (EFFECTS["exhaust_restriction"](),)
    small = {"exhaust_restriction.R": 3e10, "exhaust_restriction.tau": 0.03}
    tight = {**small, "exhaust_restriction.C_leak": 1e-15}
    assert fit_model(study, effects, {**nominal.values, **tight}).cost > nominal.cost - 1000
    for known in ({}, small):
        cost = fit_model(study, effects, {**nominal.values, **known}).cost
        assert cost < nominal.cost - 5000


@pytest.mark.slow
def test_a_narrow_hose_is_found_from_the_start(made_case):
    """From a wide one, which is not felt, the fit lets the volume vanish."""
    study, _ = prepare_study(made_case(301, 4.0, hose_volume="large"))
    nominal, effects = fit_model(study, ()), (EFFECTS["hose_volume"](),)
    wide = {"hose_volume.V": 1.5e-4, "hose_volume.C": 2e-8}
    stuck = fit_model(study, effects, {**nominal.values, **wide}, credible=False)
    assert stuck.cost > nominal.cost - 200
    assert fit_model(study, effects, nominal.values).cost < nominal.cost - 1200


def test_a_start_looked_for_at_full_size_is_not_replaced_by_the_shape_a_screen_promises():
    shapes = [{"e.s": 0.95, "e.zeta": 0.1}, {"e.s": 0.05, "e.zeta": 0.1}, {"e.zeta": 0.2}]
    assert _without({"e.s"}, shapes) == [{"e.zeta": 0.1}, {"e.zeta": 0.2}]
    assert _without((), shapes) == shapes
