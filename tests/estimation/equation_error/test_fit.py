"""Fits of the balances: their derivatives, and that they end where nothing is left to gain."""

import numpy as np
import pytest

from pneumo_casadi.diagnosis import applicable, prepare_study
from pneumo_casadi.diagnosis.prepare.study import fit_model, refine_model
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.residuals import balance_residuals, linearise_residuals


@pytest.fixture(scope="module")
def one(made_case):
    return prepare_study(made_case(12, flow_map_shape="large"))[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("names", "moved"),
    [
        (("flow_map_shape", "leakage_P"), ()),
        (("valve_dead_zone", "stribeck", "position_delay"), ("position_delay.T",)),
        (("valve_hysteresis", "spring_load"), ("valve_hysteresis.h",)),
    ],
)
def test_derivatives_to_what_no_state_and_no_sensor_knows_are_exact(one, names, moved):
    catalogue = applicable(one, EFFECTS)
    model = BalanceFunctions(
        one.axis.with_effects(*(catalogue[n]() for n in names)).at_starting_values()
    )
    assert model.by_difference == moved
    parameters, data = model.axis.parameters, one.smoothed[0][0]
    J = linearise_residuals(model, data, parameters.values).J
    for name in set(model.effect_parameters) - set(moved):
        at, h = parameters.index(name), 1e-4 * parameters[name].scale
        below, above = parameters.values.copy(), parameters.values.copy()
        below[at] -= h
        above[at] += h
        expected = (
            balance_residuals(model, data, above) - balance_residuals(model, data, below)
        ) / (2 * h)
        found = J[:, :, model.free.index(name)]
        assert np.linalg.norm(found - expected) <= 0.01 * np.linalg.norm(expected), name


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hose", "heat_transfer"])
def test_whole_derivatives_tell_what_states_make_of_nominal_parameters(one, name):
    effect = applicable(one, EFFECTS)[name]()
    model = BalanceFunctions(one.axis.with_effects(effect).at_starting_values())
    parameters, data = model.axis.parameters, one.smoothed[0][0]
    found = {w: linearise_residuals(model, data, parameters.values, w).J for w in (False, True)}
    assert model.state_dependent
    left_out = 0.0
    for i, nominal in enumerate(model.free):
        at, h = parameters.index(nominal), 1e-3 * parameters[nominal].scale
        below, above = parameters.values.copy(), parameters.values.copy()
        below[at] = max(below[at] - h, parameters[nominal].lower)
        above[at] += h
        change = balance_residuals(model, data, above) - balance_residuals(model, data, below)
        expected = change / (above[at] - below[at])
        size = np.linalg.norm(expected)
        off = {w: np.linalg.norm(J[:, :, i] - expected) for w, J in found.items()}
        assert off[True] <= 0.02 * size, nominal
        if nominal not in model.state_dependent:
            assert off[False] == off[True], nominal
        left_out = max(left_out, off[False] / max(size, 1e-300))
    assert left_out > 0.05  # held states would not do


@pytest.mark.slow
def test_a_fit_along_a_bent_valley_goes_on_to_its_end(one):
    # Opening and flow coefficients of a shaped valve nearly stand for one another.
    effect = applicable(one, EFFECTS)["flow_map_shape"]()
    nominal = fit_model(one, ())
    found = fit_model(one, (effect,), nominal.values)
    again = fit_model(one, (effect,), found.values)
    assert found.cost - again.cost < 0.01 * (nominal.cost - again.cost)


@pytest.mark.slow
def test_a_refined_fit_has_nothing_left_to_gain_where_states_hang_on_the_nominal_parameters(one):
    effect = applicable(one, EFFECTS)["hose"]()
    found = fit_model(one, (effect,), fit_model(one, ()).values)
    once = refine_model(one, found, (effect,))
    again = refine_model(one, once, (effect,))
    assert once.cost < found.cost - 10  # what derivatives with held states leave
    assert once.cost - again.cost < 0.5
