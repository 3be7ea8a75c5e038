"""Fits from many starts, and from where full steps do not contract."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.effects import Stribeck
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.output_error import (
    OutputErrorOptions,
    fit_from_many_starts,
    fit_output_error,
)
from pneumo_casadi.estimation.output_error.multistart import draw_parameters
from pneumo_casadi.estimation.output_error.shooting.problem import Unknowns, shoot_segments
from pneumo_casadi.estimation.output_error.solvers import condensed_step as steps
from pneumo_casadi.estimation.output_error.solvers import levenberg_marquardt as damping
from pneumo_casadi.estimation.output_error.solvers import multiple_shooting as full_steps
from pneumo_casadi.estimation.output_error.solvers.levenberg_marquardt import (
    solve_levenberg_marquardt,
)
from pneumo_casadi.estimation.output_error.solvers.multiple_shooting import (
    solve_gauss_newton,
    solve_near_optimum,
)
from pneumo_casadi.estimation.output_error.stages import write_problem

TABLE_1 = ("X_s1", "X_s2", "X_s4", "X_s5", "M", "f_v", "F_c_plus")


@pytest.fixture(scope="module")
def problem_of(made, servo, start):
    """Everything of a fit of the servo axis to 0.3 s."""
    axis, u, x = servo
    record = made.recorded(axis, u[:300], x[:, :300], 0)
    table, begin = start(0)
    return begin, [record], table, OutputErrorOptions(widths=(made.TRUE["v_s"],))


@pytest.mark.slow
def test_starts_half_off_in_every_parameter_reach_the_same_optimum(problem_of):
    found = fit_from_many_starts(*problem_of, starts=3, spread=0.5, seed=1)
    assert len(found.outcomes) == 3 and found.agreeing == 3
    assert found.outcomes[0].start == problem_of[0].parameters
    best, std = found.best, found.best.uncertainty.std
    for outcome in found.outcomes:
        assert outcome.status == "converged" and outcome.seconds > 0
        values = [outcome.result.parameters[n].value for n in best.uncertainty.names]
        wanted = [best.parameters[n].value for n in best.uncertainty.names]
        assert np.abs((np.array(values) - wanted) / std).max() < 0.01
        assert outcome.cost == pytest.approx(found.outcomes[0].cost, rel=1e-6)


@pytest.mark.slow
def test_who_runs_the_starts_does_not_matter(problem_of):
    serial = fit_from_many_starts(*problem_of, starts=2, seed=2)
    with ThreadPoolExecutor(1) as executor:
        other = fit_from_many_starts(*problem_of, starts=2, seed=2, executor=executor)
    assert [o.cost for o in serial.outcomes] == [o.cost for o in other.outcomes]
    assert [o.start for o in serial.outcomes] == [o.start for o in other.outcomes]


def test_draws_stay_within_bounds_and_move_free_parameters_only(problem_of):
    parameters = problem_of[0].parameters.fix("M")
    moved = draw_parameters(parameters, 0.5, np.random.default_rng(0))
    assert moved["M"] == parameters["M"] and moved["v_s"] == parameters["v_s"]
    factor = moved.values / np.where(parameters.values == 0, np.nan, parameters.values)
    assert np.nanmin(factor) > 0.49 and np.nanmax(factor) < 1.51
    assert np.sum(moved.values != parameters.values) == len(parameters.free_names)
    assert np.all((moved.values >= moved.lower) & (moved.values <= moved.upper))


def test_where_no_step_helps_a_fit_has_not_converged(problem_of, monkeypatch):
    begin, records, table, options = problem_of
    problem = write_problem(begin, records, table, options)
    start = problem.start()

    def uphill(problem, point, step, share=1.0):
        return steps.apply_step(problem, point, step, -0.3)

    monkeypatch.setattr(damping, "apply_step", uphill)
    sigma = np.array([150.0, 150.0, 1.5e-5])
    found = solve_levenberg_marquardt(problem, (start,), sigma, True, 150, 1e-3)
    assert found.status == "no step helps"


@pytest.mark.slow
def test_a_force_axis_is_found_from_friction_of_another_size(made):
    axis = made.true_force_axis()
    u, x = made.controlled(axis, 1000)
    far = made.perturbed(
        axis, {"M": 7.266, "f_v": 0.16524, "F_c_plus": 13.4726, "F_c_minus": 0.047392}
    )
    options = OutputErrorOptions(widths=(made.FORCE_TRUE["v_s"],))
    result = fit_output_error(far, [made.recorded(axis, u, x, 0)], options=options)
    for name in ("M", "f_v", "F_c_plus", "F_c_minus"):
        truth = made.FORCE_TRUE[name]
        assert abs(result.parameters[name].value - truth) < 5 * result.std(name), name


@pytest.mark.slow
def test_starts_that_fail_are_told_and_none_left_is_an_error(problem_of):
    begin, records, table, _ = problem_of
    hurried = OutputErrorOptions(widths=(5e-3,), max_iterations=1, recover=False)
    found = fit_from_many_starts(begin, records, table, hurried, starts=2)
    for outcome in found.outcomes:
        assert "iterations exhausted" in outcome.status
        assert outcome.result is None and outcome.cost == np.inf
    assert found.agreeing == 0
    with pytest.raises(FitError, match="none of 2 starts"):
        found.best  # noqa: B018
    with pytest.raises(ModelError, match="at least one"):
        fit_from_many_starts(begin, records, table, starts=0)


def test_damped_steps_reach_the_optimum_of_full_ones_and_never_climb(made, problem_of):
    begin, records, table, options = problem_of
    problem = write_problem(begin, records, table, options)
    sigma = np.array([150.0, 150.0, 1.5e-5])
    start = problem.start()
    _, m = shoot_segments(problem, start.theta, start.x[:, :1])
    before = problem.cost(start.theta, m, sigma)
    full = solve_gauss_newton(problem, start, sigma, reweight=False)
    costs = []
    for limit in (1, 3, 60):
        found = solve_levenberg_marquardt(problem, (start,), sigma, False, limit, 1e-3)
        costs.append(problem.cost(found.point.theta, found.m, sigma))
    assert before >= costs[0] >= costs[1] >= costs[2]
    assert found.status == "converged"
    assert costs[2] == pytest.approx(problem.cost(full.point.theta, full.m, sigma), rel=1e-5)


@pytest.mark.parametrize(
    "contract", [True, False], ids=["full steps", "where they do not contract"]
)
def test_from_near_the_optimum_few_steps_reach_it(made, problem_of, monkeypatch, contract):
    begin, records, table, options = problem_of
    near = begin.with_parameters(fit_output_error(begin, records, table, options).parameters)
    moved = near.with_parameters({name: 1.001 * near.parameters[name].value for name in TABLE_1})
    problem = write_problem(moved, records, table, options)
    sigma = np.array([150.0, 150.0, 1.5e-5])
    measured = problem.start()
    nodes, _ = shoot_segments(problem, measured.theta, measured.x[:, :1])
    start = Unknowns(measured.theta, nodes)
    wanted = solve_gauss_newton(problem, measured, sigma, reweight=False)
    take = full_steps._full_steps
    if not contract:

        def astray(*given):
            status = "full steps do not contract"
            return replace(take(*given), status=status, point=measured, iterations=4)

        monkeypatch.setattr(full_steps, "_full_steps", astray)
    found = solve_near_optimum(problem, start, sigma, False, 60)
    assert found.status == "converged" and (found.iterations > 4) is not contract
    cost, least = (
        problem.cost(solution.point.theta, solution.m, sigma) for solution in (found, wanted)
    )
    assert abs(cost - least) < 0.05


@pytest.mark.slow
def test_gross_misfit_converges_all_the_same(made, start):
    """A stick force that the model lacks, three times its friction, over the whole record."""
    axis = made.true_axis(Stribeck()).with_parameters(
        {"stribeck.delta_F": 60.0, "stribeck.v_stribeck": 0.02}
    )
    u, x = made.controlled(axis, 800)
    table, begin = start(3)
    options = OutputErrorOptions(widths=(made.TRUE["v_s"],))
    result = fit_output_error(begin, [made.recorded(axis, u, x, 3)], table, options)
    assert result.status == "converged"
    assert result.rms[2] > 20 * 1.5e-5
