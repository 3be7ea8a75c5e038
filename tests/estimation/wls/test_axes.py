"""Regression on the package's own models: the derived regressor, EMPS and the bench of Table 1."""

import json
import logging
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from pneumo_casadi.data import read_case, read_emps
from pneumo_casadi.effects import AsymmetricViscousFriction
from pneumo_casadi.estimation.wls import (
    StickPhases,
    cross_validate,
    fit_wls,
    linear_combinations,
    structural_base,
)
from pneumo_casadi.model.servosystem import ForceAxis, Servosystem
from pneumo_casadi.signals import FilterPlan, InputPairing
from pneumo_casadi.valve import fit_polynomials, read_flow_map

BENCHMARK = Path(__file__).parents[3] / "benchmarks" / "emps.py"


@pytest.fixture(scope="module")
def emps(data_folder):
    logging.disable(logging.WARNING)
    yield read_emps(data_folder / "emps")
    logging.disable(logging.NOTSET)


@pytest.fixture(scope="module")
def benchmark(script):
    return script(BENCHMARK)


@pytest.fixture(scope="module")
def table1(data_folder):
    case = read_case(data_folder / "table1")
    return case, Servosystem(case.bench, fit_polynomials(read_flow_map(case.flow_map_path)))


@pytest.mark.data
def test_the_derived_regressor_is_eq_7_typed_out(table1, made):
    case, axis = table1
    derived, typed = axis.regressor(), made.Eq7().regressor()
    assert tuple(axis.regressor_names) == made.Eq7.regressor_names
    rng = np.random.default_rng(0)
    bench = case.bench
    for _ in range(50):
        x = [*rng.uniform(1.2e5, 6.5e5, 2), rng.uniform(-0.2, 0.2), rng.uniform(-1, 1)]
        dx = [*rng.normal(0, 1e6, 2), x[3], rng.normal(0, 5)]
        u = rng.uniform(-3, 3, 2)
        Y, W = (np.array(part) for part in derived(x, dx, u))
        _, expected = typed(x, dx, [0.0, 0.0, 0.0])
        np.testing.assert_allclose(W, np.array(expected), rtol=1e-12, atol=1e-12)
        effort = bench.S_P * x[0] - bench.S_N * x[1] - (bench.S_P - bench.S_N) * bench.p_ext
        flows = axis.flow(u, x[:2])
        np.testing.assert_allclose(Y.ravel(), [*flows, effort], rtol=1e-9)


@pytest.mark.data
def test_all_parameters_of_the_nominal_axis_are_structurally_identifiable(table1):
    _, axis = table1
    base = structural_base(axis.regressor(), axis.regressor_names, 4, 2)
    assert base.dependent == ()


@pytest.mark.data
def test_wls_on_the_bench_of_table_1_finds_mass_and_friction_and_the_chambers_roughly(table1):
    case, axis = table1
    fit = fit_wls(axis, case.identify)
    truth = [3.49e-9, 9.95e-9, 1.04e-8, 1.78e-9, 7.00e-9, 7.17e-9, 16.9, 11.0, 10.3, 23.8]
    error = np.abs(fit.estimate / truth - 1)
    assert error[6] < 0.002  # M
    assert error[7] < 0.04  # f_v
    assert np.all(error[8:] < 0.01)  # F_c
    # The polynomials' misfit (1 % of the flow) lands in X_s2 and k_P: output error mends it.
    assert np.all(error[[0, 2, 3, 5]] < 0.01) and np.all(error[[1, 4]] < 0.08)
    assert fit.derived.values == pytest.approx([1.04, 1.02], abs=0.08)
    (validated,) = cross_validate(fit, case.validate)
    assert validated.relative_error_percent["force"] < 3.0
    assert validated.relative_error_percent["mass_flow_P"] < 10.0


@pytest.fixture(scope="module")
def written(benchmark, emps, data_folder, tmp_path_factory):
    """The file that the benchmark writes when it is run from the command line.

    Run in this process: most of the time of one of its own would go into imports.
    """
    target = tmp_path_factory.mktemp("emps") / "emps.json"
    command = [str(BENCHMARK), "--data", str(data_folder / "emps"), "--quick"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [*command, "--json", str(target)])
        patch.setattr(benchmark, "run", partial(benchmark.run, seconds=1.0))
        patch.setattr(benchmark, "read_emps", lambda folder: emps)
        benchmark.main()
    return target


@pytest.mark.slow
@pytest.mark.data
def test_emps_is_reproduced_with_the_authors_recipe(written, benchmark):
    result = json.loads(written.read_text())
    for variant in ("symmetric", "asymmetric"):
        ours, authors = result[variant], benchmark.AUTHORS[variant]
        for name, value in authors["parameters"].items():
            assert ours["parameters"][name] == pytest.approx(value, rel=1e-5)
            std = authors["standard_errors"][name]
            assert ours["standard_errors"][name] == pytest.approx(std, rel=2e-3)
        for key in ("relative_error_percent", "cross_validation_percent"):
            if key in authors:
                assert ours[key] == pytest.approx(authors[key], abs=2e-4)


@pytest.mark.data
def test_the_simulated_loop_errs_no_more_than_the_authors(emps, benchmark):
    axis = ForceAxis(emps.bench)
    fit = fit_wls(
        axis,
        emps.identify,
        plan=benchmark.PLAN,
        stick=StickPhases.KEEP,
        pairing=InputPairing.SAMPLE,
    )
    for name, record in (("identification", emps.identify[0]), ("pulses", emps.validate[0])):
        ours = benchmark.closed_loop_errors(axis, fit, record)
        for signal, percent in benchmark.AUTHORS["closed_loop"][name].items():
            assert ours[signal] < percent


@pytest.mark.data
def test_pairing_force_with_its_hold_predicts_the_pulses_better(emps):
    axis = ForceAxis(emps.bench)
    plan = FilterPlan(1e3, cutoff=100.0, factor=10, f_dyn=20.0)
    error = {}
    for pairing in InputPairing:
        fit = fit_wls(axis, emps.identify, plan=plan, stick=StickPhases.KEEP, pairing=pairing)
        error[pairing] = cross_validate(fit, emps.validate)[0].relative_error_percent["force"]
    assert error[InputPairing.MEAN_OF_HOLDS] < 4.7 < 5.8 < error[InputPairing.SAMPLE]


@pytest.mark.data
def test_asymmetric_friction_halves_the_error_by_one_effect_linear_in_its_parameter(emps):
    plain = ForceAxis(emps.bench)
    wider = plain.with_effects(AsymmetricViscousFriction())
    before, after = (fit_wls(axis, emps.identify) for axis in (plain, wider))
    name = "asymmetric_viscous_friction.delta_f_v"
    assert after.parameters[name].value == pytest.approx(-38.0, abs=3.0)
    assert after.relative_error_percent["force"] < 0.65 * before.relative_error_percent["force"]
    combined = linear_combinations(after, {"F_v_minus": {"f_v": 1.0, name: -1.0}})
    assert combined.values[0] == pytest.approx(234.0, abs=5.0)


@pytest.mark.slow
@pytest.mark.data
def test_the_benchmark_writes_its_figures(written):
    content = json.loads(written.read_text())
    assert {"symmetric", "asymmetric", "closed_loop", "machine", "versions", "seed"} <= set(content)
    assert set(content["closed_loop"]["pulses"]) == {
        "position",
        "velocity",
        "acceleration",
        "force",
    }
    assert list(written.parent.iterdir()) == [written]
