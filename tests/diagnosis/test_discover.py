"""Terms outside the catalogue: balance, driver, formula and size, from records with one."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from pneumo_casadi.data import ForceBench, InputHold, NestedController, Recording, read_case
from pneumo_casadi.diagnosis.discover.discover import discover_term, propose_term
from pneumo_casadi.diagnosis.discover.discovered import causes_in
from pneumo_casadi.diagnosis.discover.joint_fit import fit_jointly
from pneumo_casadi.diagnosis.discover.linear.linearised import linearise
from pneumo_casadi.diagnosis.discover.linear.sites import Site
from pneumo_casadi.diagnosis.discover.periods import periodogram, sines_remove
from pneumo_casadi.diagnosis.discover.search import search
from pneumo_casadi.diagnosis.discover.term_in_model import fit_with_term, told_as_fitted
from pneumo_casadi.diagnosis.metrics.residual_size import balance_levels
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.diagnosis.prepare.noise_bias import without_noise_bias
from pneumo_casadi.diagnosis.prepare.prepare_study import prepare_study
from pneumo_casadi.diagnosis.prepare.study import start_study
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.effects.term import Term, term_effect
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
    assert periodogram(linear, site, grid) == pytest.approx(exact, rel=0.1, abs=0.02 * exact.max())


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
