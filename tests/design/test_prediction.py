"""What is predicted of an experiment is what a fit to it finds, on the package's own model."""

from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import Load
from pneumo_casadi.design import DesignOptions, Part, design_for_precision, design_to_separate
from pneumo_casadi.design.experiment import ExperimentSimulator
from pneumo_casadi.design.options import (
    SimulationRate,
    feasible_finalists,
    recorded_reference,
    simulation_rates,
)
from pneumo_casadi.design.precision import PrecisionForecast, parameters_of_interest
from pneumo_casadi.design.prediction import Fit, noise_free_map, project_refit, refit
from pneumo_casadi.design.reference import make_reference
from pneumo_casadi.design.search import SearchResult
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.model.machine_code.compilation import generate_code
from pneumo_casadi.report.pages.design import write_design


@pytest.fixture(scope="module")
def record(made):
    """Two seconds under control, with sensor noise."""
    axis = made.true_axis()
    result = made.recorded(axis, *made.controlled(axis, 2000, substeps=4), seed=1)
    return result.with_channels({"x_ref": made.reference(result.t)})


@pytest.mark.slow
def test_standard_errors_are_those_of_the_fit(made, record):
    table = made.measured_map(0)
    begin = made.true_axis(flow=made.fit_polynomials(table, (3, 3, 3)))
    options = OutputErrorOptions(widths=(made.TRUE["v_s"],))
    result = fit_output_error(begin, [record], table, options)
    names = parameters_of_interest(result.axis)
    forecast = PrecisionForecast(
        result.axis, table, SimulationRate(record.dt, result.sigma, 0.0), names
    )
    run = forecast.run(recorded_reference(record))
    std = np.sqrt(np.diag(forecast.covariance([run])))
    for name, predicted in zip(names, std, strict=True):
        assert predicted == pytest.approx(result.std(name), rel=0.1), name


def test_a_common_mode_moves_the_mean_pressure_and_hardly_the_piston(made, limits):
    axis = made.true_axis()
    simulator = ExperimentSimulator(axis, 1e-3)
    still = Part("holds", 1.0, (0.05,))
    plain = simulator(make_reference((still,), 1e-3, 2000, 0.1, limits.common))
    step = Part("common_mode_steps", 1.0, (0.0, 1.0, 8.0))
    raised = simulator(make_reference((still, step), 1e-3, 2000, 0.1, limits.common))
    assert raised.y[:2, -1].mean() > plain.y[:2, -1].mean() + 5e4
    assert abs(raised.y[2, -1] - plain.y[2, -1]) < 0.02


def test_an_axis_begins_where_it_rests(made, recorded):
    simulator = ExperimentSimulator(made.true_axis(), 1e-3)
    p_P, p_N = simulator.rest_pressures
    bench = made.BENCH
    force = bench.S_P * p_P - bench.S_N * p_N - (bench.S_P - bench.S_N) * bench.p_ext
    assert abs(force) < made.TRUE["F_c_plus"]
    settled = simulator(recorded).y[:2, 0]
    assert settled == pytest.approx([p_P, p_N], rel=0.05)


def test_a_recorded_supply_rests_during_an_experiment(made):
    still = make_reference((Part("holds", 1.0, (0.05,)),), 1e-3, 200, 0.1, 0.0)
    plain, supplied = (
        ExperimentSimulator(axis, 1e-3)(still) for axis in (made.true_axis(), made.supplied_axis())
    )
    assert np.all(supplied.u[2] == made.P_SUPPLY)
    np.testing.assert_allclose(supplied.y, plain.y)


@pytest.mark.parametrize("angle", [90.0, -90.0])
def test_a_vertical_axis_begins_with_its_weight_balanced(made, angle):
    axis = replace(made.true_axis(), bench=replace(made.BENCH, load=Load(angle_deg=angle)))
    p_P, p_N = ExperimentSimulator(axis, 1e-3).rest_pressures
    bench, weight = made.BENCH, np.sign(angle) * 9.80665 * made.TRUE["M"]
    force = bench.S_P * p_P - bench.S_N * p_N - (bench.S_P - bench.S_N) * bench.p_ext
    assert force == pytest.approx(weight, abs=made.TRUE["F_c_plus"])


def test_a_projection_is_the_refit_to_first_order(made, sigma):
    axis = made.true_axis()
    other = axis.with_effects(EFFECTS["quadratic_drag"]()).at_starting_values()
    simulator = ExperimentSimulator(other, 1e-3)
    fit = Fit(axis, 1e-3, sigma, noise_free_map(axis, made.smooth_map()))
    run = simulator(make_reference((Part("squares", 1.0, (0.9, 0.3, 1.0)),), 1e-3, 1500, 0.15, 0.0))
    replicate = refit(fit, run)
    start = axis.parameters.values
    assert replicate.distance > 10
    assert project_refit(fit, run, start).distance == pytest.approx(replicate.distance, rel=0.05)


def test_a_model_is_at_no_distance_from_itself(made, sigma, recorded):
    axis = made.true_axis()
    fit = Fit(axis, 1e-3, sigma, noise_free_map(axis, made.smooth_map()))
    assert refit(fit, ExperimentSimulator(axis, 1e-3)(recorded)).distance < 0.01


def test_the_coarse_clock_says_as_much_in_a_second(made, sigma):
    axis = made.true_axis()
    fine, coarse = simulation_rates(axis, sigma)
    assert sigma**2 * fine.dt == pytest.approx(coarse.sigma**2 * coarse.dt)


@pytest.mark.slow
def test_a_design_is_better_than_the_record_and_keeps_the_limits(made, recorded, limits, sigma):
    table, axis = made.smooth_map(), made.true_axis()
    options = DesignOptions(limits, 2.0, evaluations=40)
    design = design_for_precision(axis, [recorded], table, sigma, options)
    assert design.gain > 1.3
    assert design.precision.after < design.precision.before
    assert (design.precision.together < design.precision.now).all()
    run, again = (
        design.runs["nominal"],
        ExperimentSimulator(axis, design.reference.dt)(design.reference),
    )
    np.testing.assert_allclose(again.y, run.y)
    assert again.excess(limits) == 0.0
    assert np.abs(again.x[2]).max() <= limits.position
    assert np.abs(again.x[3]).max() <= limits.velocity
    assert np.abs(again.u).max() <= limits.command
    assert again.x[:2].min() >= limits.p_min and again.x[:2].max() <= limits.p_max


@pytest.mark.slow
def test_impossible_limits_say_by_how_much(made, recorded, limits, sigma):
    options = DesignOptions(
        type(limits)(0.2, 1e-3, limits.p_min, limits.p_max, 3.0), 1.0, evaluations=20
    )
    with pytest.raises(FitError, match="exceeds them by"):
        design_for_precision(made.true_axis(), [recorded], made.smooth_map(), sigma, options)


def test_without_a_finalist_that_counts_no_excess_of_nothing_is_told(made, limits, sigma):
    axis = made.true_axis()
    rate, _ = simulation_rates(axis, sigma)
    search = SearchResult((), 0.0, ())
    with pytest.raises(FitError, match="no reference that keeps the limits tells") as raised:
        feasible_finalists(search, DesignOptions(limits, 1.0), {"": axis}, rate)
    assert "0 %" not in str(raised.value)


def test_a_parameter_at_a_bound_is_no_aim_of_a_design(made, limits, sigma):
    axis = made.true_axis().with_parameters({"f_v": 0.0})
    assert "f_v" in parameters_of_interest(made.true_axis())
    assert set(parameters_of_interest(axis)) == {
        *(f"X_s{i}" for i in range(1, 7)),
        *("M", "F_c_plus", "F_c_minus"),
    }
    options = DesignOptions(limits, 1.0, evaluations=20)
    with pytest.raises(ModelError, match="f_v is held by a bound"):
        design_for_precision(axis, [], None, sigma, options, names=("M", "f_v"))


def test_what_is_absorbed_whatever_the_axis_does_is_not_searched_for(made, recorded, limits, sigma):
    axis = made.true_axis()
    axes = {
        "none": axis,
        "constant_force": axis.with_effects(EFFECTS["constant_force"]()).at_starting_values(),
    }
    options = DesignOptions(limits, 1.0, evaluations=20)
    with pytest.raises(ModelError, match="absorb"):
        design_to_separate(axes, axis, [recorded], made.smooth_map(), sigma, options)


@pytest.mark.slow
def test_an_effect_is_told_from_the_nominal_axis_and_written_down(
    made, recorded, limits, sigma, tmp_path
):
    axis = made.true_axis()
    drag = axis.with_effects(EFFECTS["quadratic_drag"]()).at_starting_values()
    options = DesignOptions(limits, 1.0, evaluations=20)
    axes = {"quadratic_drag": drag, "none": axis}
    design = design_to_separate(axes, axis, [recorded], made.smooth_map(), sigma, options)
    before, after = design.smallest
    assert [(distance.truth, distance.fitted) for distance in design.distances] == [
        ("quadratic_drag", "none")
    ]
    assert after > 2 * before and design.gain == pytest.approx(after / before)
    assert all(run.excess(limits) == 0.0 for run in design.runs.values())
    folder = write_design(design, tmp_path / "design")
    files = {"design.json", "design.txt", "design.png", "design.svg", "design.pdf", "reference.csv"}
    files |= {"report.html", ".pneumo_casadi.json"}
    assert {path.name for path in folder.iterdir()} == files
    assert "quadratic_drag" in (folder / "design.txt").read_text("utf-8")


def test_an_experiment_is_little_more_code_with_many_steps(made):
    axis = made.true_axis().with_parameters({"v_s": 1e-4})
    codes = []
    for dt in (2e-4, 1e-2):
        simulator = ExperimentSimulator(axis, dt)
        codes.append(generate_code([simulator.sample]))
    assert simulator.model.stepping.substeps > 16
    assert len(codes[1]) < 3 * len(codes[0])
