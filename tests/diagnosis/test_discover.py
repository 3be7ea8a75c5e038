"""Terms outside the catalogue: balance, driver, formula and size, from records with one."""

from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.data import ForceBench, InputHold, NestedController, Recording, read_case
from pneumo_casadi.diagnosis.discover import beside, discover, joint_fit
from pneumo_casadi.diagnosis.discover.beside import complete_term
from pneumo_casadi.diagnosis.discover.discover import NAME, discover_term, propose_term
from pneumo_casadi.diagnosis.discover.discovered import causes_in
from pneumo_casadi.diagnosis.discover.formula_fits import fit_formula
from pneumo_casadi.diagnosis.discover.joint_fit import fit_jointly
from pneumo_casadi.diagnosis.discover.linear.linearised import linearise
from pneumo_casadi.diagnosis.discover.linear.sites import Site
from pneumo_casadi.diagnosis.discover.periods import periodograms, sines_remove
from pneumo_casadi.diagnosis.discover.search import predicted_by, search
from pneumo_casadi.diagnosis.discover.term_in_model import fit_with_term, told_as_fitted
from pneumo_casadi.diagnosis.metrics.findings import Closure
from pneumo_casadi.diagnosis.metrics.residual_size import balance_levels
from pneumo_casadi.diagnosis.prepare.begun_jobs import BegunJobs
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.diagnosis.prepare.noise_bias import without_noise_bias
from pneumo_casadi.diagnosis.prepare.prepare_study import prepare_study
from pneumo_casadi.diagnosis.prepare.study import start_study
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.effects.term import Term, term_effect
from pneumo_casadi.effects.term.formula import FORMULAS
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.residuals import balance_residuals
from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.identification.flow_form import resolve_flow_form
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.model.servosystem import ForceAxis
from pneumo_casadi.model.simulation import simulate

FS = 500.0
TRUTH = {"M": 18.0, "f_v": 25.0, "F_c_plus": 12.0, "F_c_minus": 17.0}
NOISE = 5e-6
COGGING = Term(
    "cogging",
    ("force",),
    "1",
    "x",
    "sine",
    {"amplitude": 6.0, "phase": 0.4, "period": 0.011},
)
#: Half a turn of it is what the filters take from the beginning of a record.
HUM = Term("hum", ("force",), "1", "t", "sine", {"amplitude": 9.0, "phase": 1.0, "period": 0.1})
TIGHT = Term("tight", ("force",), "sign(v)", "x", "line", {"slope": -120.0})


def record(axis, seed):
    rng = np.random.default_rng(seed)
    t = np.arange(2250) / FS
    f = rng.uniform(0.7, 1.1, 3) * np.array([0.5, 1.1, 2.0])
    F = sum(A * np.sin(2 * np.pi * f_i * t) for A, f_i in zip((45, 40, 35), f, strict=True))
    run = simulate(axis, F[:, None], 1 / FS, [0.0] * len(axis.states))
    x = run["x"] + NOISE * rng.normal(size=t.size)
    return Recording(t, {"F": F, "x": x}, f"record {seed}", "simulated", InputHold.ZERO)


@pytest.fixture(scope="module")
def fitted_of():
    """Return a function that makes a study of an axis with terms, and fits the axis without."""
    known = {}

    def of(*terms):
        key = repr(terms)
        if key not in known:
            known[key] = _fitted_with(*terms)
        return known[key]

    return of


def _fitted_with(*terms):
    study = study_of(*terms)
    return study, fit_model(study, ())


def study_of(*terms):
    axis = ForceAxis(ForceBench(FS, 0.5, NestedController(30.0, 60.0, 1.0, 60.0)))
    true = axis.with_effects(*(term_effect(term)() for term in terms)).at_starting_values()
    true = true.with_parameters({**TRUTH, "v_s": 1e-3})
    return start_study(axis, None, [record(true, 1)], [record(true, 2)])


@pytest.mark.slow
@pytest.mark.parametrize("term", [COGGING, HUM, TIGHT], ids=lambda term: term.name)
def test_a_term_is_told_with_its_driver_and_its_size(fitted_of, term):
    study, nominal = fitted_of(term)
    found = discover_term(study, nominal, (), balance_levels(study))
    assert found is not None
    assert (found.term.balances, found.term.driver) == (term.balances, term.driver)
    assert (found.term.factor, found.term.formula) == (term.factor, term.formula)
    for name in set(term.parameters) - {"phase"}:
        assert found.term.parameters[name] == pytest.approx(term.parameters[name], rel=0.05)
    assert found.closes.lower > 0.7
    assert found.curve.band.shape == found.curve.value.shape == found.curve.driver.shape
    model = fit_with_term(study, found, (nominal, ()))
    told = told_as_fitted(found, without_noise_bias(study, *model))
    for name, item in told.parameters.items():
        assert item.std > 0
        assert abs(item.value - term.parameters[name]) < 4 * item.std, name


@pytest.mark.slow
@pytest.mark.parametrize(("cycles", "formula"), [(1.8, "sine"), (1.2, None)])
def test_a_sine_of_less_than_two_periods_has_its_own(fitted_of, cycles, formula):
    """Once found at two it is refined; one that ends at the fewest is a bend."""
    stroke = float(np.ptp(fitted_of()[0].train[0]["x"]))
    wave = {"amplitude": 6.0, "phase": 0.4, "period": stroke / cycles}
    study, nominal = _fitted_with(Term("wave", ("force",), "1", "x", "sine", wave))
    found = discover_term(study, nominal, (), balance_levels(study))
    assert found is not None and found.term.driver == "x"
    if formula is None:
        assert found.term.formula != "sine"
    else:
        assert found.term.formula == formula
        assert found.term.parameters["period"] == pytest.approx(wave["period"], rel=0.02)


@pytest.mark.slow
def test_a_force_that_the_mass_takes_up_is_seen_over_time(made_case):
    """It shakes the axis, so that a smaller mass explains most of it, but not of other motion."""
    study, _ = prepare_study(made_case(12, vibration="large"))
    linear = linearise(study, fit_model(study, ()), ())
    site = Site(("force",), "1", "t")
    grid = np.arange(5.0, 7.0, 0.125)
    exact = sines_remove(linear, site, grid)
    columns = [linear.train.columns(site, partial(_sine, f)) for f in grid]
    assert exact == pytest.approx([linear.removed_squares(each) for each in columns])
    assert min(linear.observable(each).min() for each in columns) < 0.5
    (power,) = periodograms(linear, [site], grid)
    assert power == pytest.approx(exact, rel=0.1, abs=0.02 * exact.max())


def _sine(frequency, t):
    return np.column_stack([np.sin(2 * np.pi * frequency * t), np.cos(2 * np.pi * frequency * t)])


@pytest.mark.slow
def test_a_vibration_is_told_whatever_the_hour_of_a_record(fitted_of):
    """The held-out record begins ten hours later by the clock of the log: that ended the search."""
    study, _ = fitted_of(HUM)
    (held_out,) = study.held_out
    later = replace(held_out, t=held_out.t + 36000.0)
    study = start_study(study.axis, None, study.train, [later])
    term = discover_term(study, fit_model(study, ()), (), balance_levels(study))
    assert term.term.driver == "t"
    assert term.parameters["period"].value == pytest.approx(0.1, rel=0.01)


@pytest.fixture
def over_time_alone(monkeypatch):
    """Look for a force over time and nothing else: other sites take most of the search."""
    sites = (Site(("force",), "1", "t"),)
    monkeypatch.setattr("pneumo_casadi.diagnosis.discover.search.all_sites", lambda kind: sites)


def later(record, by):
    return replace(record, t=record.t + by)


@pytest.mark.parametrize("apart", [0.05, 150.05])
def test_a_vibration_has_its_own_phase_in_each_record(fitted_of, over_time_alone, apart):
    """One phase for two records, half a period apart by their clocks, fits neither."""
    study, _ = fitted_of(HUM)
    (first,), (second,) = study.train, study.held_out
    records = [first, later(first, apart)], [second, later(second, 0.02)]
    study = start_study(study.axis, None, *records)
    nominal = fit_model(study, ())
    term = discover_term(study, nominal, (), balance_levels(study))
    assert term.parameters["amplitude"].value == pytest.approx(9.0, rel=0.02)
    assert term.closes.lower > 0.9
    assert fit_with_term(study, term, (nominal, ())) is None  # it would have one phase


def test_a_model_with_a_vibration_is_none_of_records_with_another_phase(fitted_of, over_time_alone):
    study, _ = fitted_of(HUM)
    held_out = [later(study.held_out[0], 0.05)]
    study = start_study(study.axis, None, study.train, held_out)
    nominal, levels = fit_model(study, ()), balance_levels(study)
    term = propose_term(study, nominal, (), levels)
    selection = SimpleNamespace(nominal=nominal, levels=levels, directions={})
    discovery = complete_term(study, selection, term, (nominal, ()), {})
    assert discovery.term is term and discovery.model is None


@pytest.mark.parametrize(
    ("names", "closes", "of_nominal", "of_without", "useful"),
    [
        (("leakage_P", NAME), 0.2, 0.8, 0.6, True),
        (("leakage_P",), 0.2, 0.8, 0.6, False),  # without the term
        (("leakage_P", NAME), 0.2, 0.4, 0.6, False),  # all together leave most of the gap
        (("leakage_P", NAME), 0.2, 0.8, 0.4, True),  # one that is not needed may do what it does
        (("leakage_P", NAME), 0.2, 0.8, 0.3, False),  # the others leave little to the term
        ((NAME,), 0.2, 0.8, None, True),
        (("leakage_P", NAME), 0.6, 0.4, 0.3, True),  # it explains the gap alone
        (("leakage_P",), 0.6, 0.8, 0.6, False),
    ],
)
def test_a_search_beside_a_term_goes_on_while_it_may_explain_the_gap(
    monkeypatch, names, closes, of_nominal, of_without, useful
):
    """What acts beside a term that was not told in the end took up to half a minute."""
    nominal, whole, without = (SimpleNamespace(effects=()) for _ in range(3))
    closures = {id(nominal): of_nominal, id(without): of_without}
    begun, begun_fits = Future(), BegunJobs()
    begun_fits.add(names, None, begun)
    ledger = SimpleNamespace(
        fits={names: whole},
        fit_without=lambda names, some: {NAME: None if of_without is None else without},
        begun_fits=begun_fits,
    )
    answers = []

    def complete(ledger, nominal, begin, levels, useful):
        answers.append(useful(names))
        raise ModelError("that was all")

    monkeypatch.setattr(beside, "fit_with_term", lambda *given: (whole, ()))
    monkeypatch.setattr(beside, "_is_out_of_phase", lambda *given: False)
    monkeypatch.setattr(beside, "residual_rms", lambda fitted: np.ones(1))
    monkeypatch.setattr(beside, "_ledger_with", lambda *given: (ledger, (NAME,)))
    monkeypatch.setattr(beside, "complete", complete)
    monkeypatch.setattr(
        beside,
        "balance_closure",
        lambda before, after, levels: Closure(0.3, 0.2, closures[id(before)]),
    )
    levels = SimpleNamespace(criteria=CRITERIA, exceeded=lambda rms, least: rms > 0)
    selection = SimpleNamespace(nominal=nominal, levels=levels)
    term = SimpleNamespace(closes=Closure(closes, 0.1, 0.9))
    told = complete_term(None, selection, term, (nominal, ()), {})
    assert answers == [useful]
    assert (told is not None) is (closes > 0.5)  # alone, since the search beside it has failed
    assert begun.cancelled()


LINE = Term("discovered", ("force",), "1", "t", "line", {"slope": 1.0})


@pytest.mark.parametrize(
    ("second", "searched"),
    [
        (replace(LINE, parameters={"slope": 2.0}), 1),
        (replace(LINE, driver="x"), 2),
        (COGGING, 2),
    ],
    ids=["another size", "another driver", "another formula"],
)
def test_a_term_refused_beside_one_model_is_not_searched_in_another_size(
    monkeypatch, second, searched
):
    asked = []
    proposed = [SimpleNamespace(term=term) for term in (LINE, second)]
    monkeypatch.setattr(beside, "propose_term", lambda *given: proposed.pop(0))
    monkeypatch.setattr(
        beside, "complete_term", lambda study, selection, term, *given: asked.append(term)
    )
    selection = SimpleNamespace(nominal="nominal", final="final", levels=None)
    assert beside.discover_beside(None, selection, (), {}) is None
    assert len(asked) == searched


def test_a_wave_of_another_period_is_another_term():
    other = replace(COGGING, parameters={**COGGING.parameters, "period": 0.02})
    assert not beside._same_form(COGGING, other)


def test_what_records_held_out_do_not_show_is_not_looked_for(fitted_of):
    """Their noise floor says nothing of a noisier record that was fitted."""
    study, _ = fitted_of()
    (record,) = study.train
    noise = 2e-4 * np.random.default_rng(0).normal(size=record.N)
    noisy = record.with_channels({"x": record["x"] + noise})
    study = start_study(study.axis, None, [noisy], study.held_out)
    levels = balance_levels(study)
    linear = linearise(study, fit_model(study, ()), ())
    assert linear.train.rms[0] > 3 * levels.noise[0]
    balances = {item.fit.site.balances for item in search(linear, levels)}
    assert ("force",) not in balances


@pytest.mark.slow
def test_a_term_whose_joint_fit_leaves_the_finite_numbers_is_none(fitted_of, monkeypatch):
    """Its diagnosis ended with "SVD did not converge"."""

    def fail(*given):
        raise np.linalg.LinAlgError("SVD did not converge")

    study, nominal = fitted_of(COGGING)
    levels = balance_levels(study)
    assert propose_term(study, nominal, (), levels) is not None
    monkeypatch.setattr(discover, "fit_jointly", fail)
    assert propose_term(study, nominal, (), levels) is None


@pytest.mark.slow
def test_nothing_is_discovered_where_nothing_is_missing(fitted_of):
    study, nominal = fitted_of()
    assert discover_term(study, nominal, (), balance_levels(study)) is None


@pytest.mark.slow
def test_residuals_with_a_term_are_those_of_its_effect(fitted_of):
    study, nominal = fitted_of(TIGHT)
    levels = balance_levels(study)
    best = search(linearise(study, nominal, ()), levels)[0].fit
    joint = fit_jointly(study, nominal, (), best)
    site, law = joint.fit.site, joint.fit.formula
    effect = term_effect(
        Term("found", site.balances, site.factor, site.driver, law.name, joint.fit.parameters)
    )()
    axis = study.axis.with_effects(effect).at_starting_values()
    model = BalanceFunctions(axis.with_parameters(dict(joint.model.values)))
    motion = study.smoothed[0][0]
    used = joint.model.used_train[0]
    expected = balance_residuals(model, motion, model.axis.parameters.values)[used]
    assert joint.model.train[0][used] == pytest.approx(expected, abs=0.01 * np.std(expected))


@pytest.mark.parametrize("steps", [1, joint_fit.STEPS])
def test_what_is_told_of_a_term_belongs_to_one_set_of_parameters(fitted_of, monkeypatch, steps):
    """Where the last step had not settled, residuals were those before it."""
    study, nominal = fitted_of(TIGHT)
    linear = linearise(study, nominal, ())
    best = fit_formula(linear, Site(("force",), "sign(v)", "x"), FORMULAS["line"])
    monkeypatch.setattr(joint_fit, "STEPS", steps)
    joint = fit_jointly(study, nominal, (), best)
    again = linearise(study, joint.model, ())
    train, _ = predicted_by(again, joint.fit, refitted=False)
    expected = np.hstack(again.train.unweighted(train))
    size = np.sqrt(np.mean(expected**2))
    assert np.hstack(joint.model.train) == pytest.approx(expected, abs=0.01 * size)


@pytest.mark.slow
def test_a_drift_of_another_program_is_told_from_times_far_apart(data_folder):
    """`benchmarks/verdicts.py` diagnoses this case and others of unlisted causes."""
    case = read_case(data_folder / "practice_more" / "q09_unlisted")
    (fitted,), (held_out,) = case.identify, case.validate
    parts = tuple(fitted.window(*part) for part in ((0.0, 3.0), (16.0, 19.0)))
    case = replace(case, identify=parts, validate=(held_out.window(0.0, 5.0),))
    options, _ = resolve_flow_form(case, IdentifyOptions())
    study, _ = prepare_study(case, options)
    term = discover_term(study, fit_model(study, ()), (), balance_levels(study))
    assert term is not None and term.term.driver == "t"
    assert term.parameters["slope"].value == pytest.approx(-7.711e-3, rel=0.01)
    assert term.closes.lower > 0.85


def test_what_acts_beside_a_term_is_told_by_its_cause():
    effects = [EFFECTS[n]() for n in ("valve_null_shift_warming", "hose_volume", "hose")]
    assert causes_in(effects) == ("valve_null_shift", "hose")


@pytest.mark.slow
def test_a_spring_is_proposed_as_a_line_over_position(made_case):
    """Why a term that does what effects do is not told; `benchmarks/rule_cases.py` tells them."""
    effects = {"spring_load": "medium", "leakage_N": "medium"}
    study, _ = prepare_study(made_case(12, 2.0, position_nonlinearity="medium", **effects))
    spring = propose_term(study, fit_model(study, ()), (), balance_levels(study)).term
    assert (spring.balances, spring.formula, spring.driver) == (("force",), "line", "x")


@pytest.mark.slow
def test_output_error_fits_a_term_like_any_effect(fitted_of):
    study, _ = fitted_of(TIGHT)
    axis = study.axis.with_effects(term_effect(TIGHT)()).at_starting_values()
    axis = axis.with_parameters({"tight.slope": -60.0})
    short = [each.window(0.0, 1.5) for each in study.train]
    options = OutputErrorOptions(window=0.5, widths=(1e-3,))
    result = fit_output_error(axis, short, None, options)
    assert result.parameters["tight.slope"].value == pytest.approx(-120.0, rel=0.05)
