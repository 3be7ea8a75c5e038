"""Costs of starts after one linear step of the parameters known so far."""

import numpy as np
import pytest

from pneumo_casadi.diagnosis import prepare_study
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.fit import (
    default_residual_floor,
    equation_error_costs,
)
from pneumo_casadi.estimation.equation_error.problem import DAMPING, Problem, Trial
from pneumo_casadi.estimation.equation_error.projected_costs import ProjectedCosts

SIZES = 0.012 * 1.02 ** np.arange(61)


@pytest.fixture(scope="module")
def study(made_case):
    """A case whose spools stick; the label says how far."""
    return prepare_study(made_case(4, valve_hysteresis_stiction={"width": 0.05}))[0]


@pytest.fixture(scope="module")
def costs(study):
    """Costs at some values of the stiction beside the nominal fit, with what is held or plain."""
    nominal = fit_model(study, ())
    axis = study.axis.with_effects(EFFECTS["valve_stiction"]()).at_starting_values()
    axis = axis.with_parameters(dict(nominal.values))

    def run(sizes, held=None, M=axis.parameters["M"].value):
        values = [axis.parameters.with_values({"valve_stiction.h": h}).values for h in sizes]
        for each in values:
            each[axis.parameters.index("M")] = M
        return np.array(
            equation_error_costs(
                axis,
                values,
                study.smoothed[0],
                study.anchor_with(axis.effects),
                residual_floor=default_residual_floor(study.axis),
                held=held,
            )
        )

    return run


def test_the_true_value_costs_least_once_the_others_give_way(costs):
    """Beside a flow map that has taken on part of the stiction, the truth may cost more."""
    plain, projected = costs(SIZES), costs(SIZES, held=())
    assert SIZES[projected.argmin()] == pytest.approx(0.025, rel=0.04)
    true = np.abs(SIZES - 0.025).argmin()
    assert projected[true] < plain[true] - 100
    assert np.partition(projected, 8)[8] > projected.min() + 100  # a valley, not a plain


def test_what_is_held_does_not_give_way(study, costs):
    everything = study.axis.parameters.free_names
    plain, all_move = costs(SIZES[::6]), costs(SIZES[::6], held=())
    assert costs(SIZES[::6], held=everything) == pytest.approx(plain, rel=1e-12)
    some = costs(SIZES[::6], held=everything[::2])
    assert (some <= plain).all() and (some < plain - 10).any()
    assert (some > all_move + 10).any()


def test_no_value_costs_more_than_where_nothing_moves(costs):
    """Also where the step of a parameter ends at its bound, or the derivatives belong elsewhere."""
    assert (costs(SIZES, held=()) <= costs(SIZES)).all()


def test_the_step_is_that_of_a_fit(study):
    """From the point of the derivatives the cost is what a fit predicts for its first step."""
    axis = study.axis.with_effects(EFFECTS["spring_load"]()).at_starting_values()
    floor = default_residual_floor(study.axis)
    problem = Problem(
        BalanceFunctions(axis), study.smoothed[0], study.anchor_with(axis.effects), floor, False
    )
    theta = axis.parameters.values
    linear = problem.linearise(Trial(theta, np.inf))
    step = problem.step(linear, DAMPING.start)
    predicted = linear.e + linear.A @ step.delta
    sigma = problem.sigma(problem.residuals(theta))
    rows = problem.weights.size
    squares = np.sum(predicted[:rows].reshape(problem.weights.shape) ** 2, axis=1)
    left = np.sqrt(squares / problem.n_rows * sigma**2 + floor**2)
    expected = problem.n_rows @ np.log(left) + 0.5 * np.sum(predicted[rows:] ** 2)
    assert ProjectedCosts(problem, theta)([theta]) == pytest.approx([expected])
    assert expected < problem.costs([theta])[0] - 100


def test_a_start_that_is_no_number_costs_infinitely_much(costs):
    assert np.isinf(costs([0.02], held=(), M=np.nan)).all()


def test_where_the_derivatives_are_no_number_nothing_moves(study):
    axis = study.axis
    problem = Problem(
        BalanceFunctions(axis),
        study.smoothed[0],
        study.anchor,
        default_residual_floor(axis),
        False,
    )
    theta, nowhere = axis.parameters.values, axis.parameters.values
    nowhere[axis.parameters.index("M")] = np.nan
    assert ProjectedCosts(problem, nowhere)([theta]) == problem.costs([theta])
