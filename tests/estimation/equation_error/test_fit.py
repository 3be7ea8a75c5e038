"""Fits of the balances: their derivatives, and that they end where nothing is left to gain."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneumo_casadi.diagnosis import applicable, prepare_study
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model, refine_model
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.residuals import balance_residuals, linearise_residuals
from pneumo_casadi.estimation.equation_error.smoothed_motion import (
    ROW_RATE,
    SmoothedMotion,
    row_windows,
)


@pytest.fixture(scope="module")
def one(made_case):
    return prepare_study(made_case(12, flow_map_shape="large"))[0]


@pytest.fixture(scope="module")
def nominal(one):
    return fit_model(one, ())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("names", "moved"),
    [
        (("flow_map_shape", "leakage_P"), ()),
        (("valve_dead_zone", "stribeck", "position_delay"), ("position_delay.T",)),
        (
            ("valve_hysteresis", "spring_load"),
            ("valve_hysteresis.h", "valve_hysteresis.s"),
        ),
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
def test_whole_derivatives_tell_what_states_make_of_nominal_parameters(one):
    effect = applicable(one, EFFECTS)["heat_transfer"]()
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
        if size > 0:  # the critical ratio of an edge that is always choked tells nothing
            assert off[True] <= 0.02 * size, nominal
        if nominal not in model.state_dependent:
            assert off[False] == off[True], nominal
        left_out = max(left_out, off[False] / max(size, 1e-300))
    assert left_out > 0.05  # held states would not do


@pytest.mark.slow
def test_a_fit_along_a_bent_valley_goes_on_to_its_end(one, nominal):
    # Opening and flow coefficients of a shaped valve nearly stand for one another.
    effect = applicable(one, EFFECTS)["flow_map_shape"]()
    found = fit_model(one, (effect,), nominal.values)
    again = fit_model(one, (effect,), found.values)
    assert found.cost - again.cost < 0.01 * (nominal.cost - again.cost)


@pytest.mark.slow
def test_a_refined_fit_has_nothing_left_to_gain_where_states_hang_on_the_nominal_parameters(
    one, nominal
):
    effect = applicable(one, EFFECTS)["hose"]()
    found = fit_model(one, (effect,), nominal.values)
    once = refine_model(one, found, (effect,))
    again = refine_model(one, once, (effect,))
    assert once.cost < found.cost - 10  # what derivatives with held states leave
    assert once.cost - again.cost < 0.5


@pytest.mark.slow
def test_a_fit_begins_where_its_cost_is_least(one, nominal):
    study, effect = one, EFFECTS["valve_null_shift"]()
    best = fit_model(study, (effect,), nominal.values)
    own = {
        name: value for name, value in best.values.items() if name.startswith("valve_null_shift.")
    }
    far = {name: 5 * value for name, value in own.items()}
    values = {name: value for name, value in best.values.items() if name not in own}
    one_step = [
        fit_model(study, (effect,), values, max_iterations=1, trials=trials, credible=False).cost
        for trials in ((far,), (far, own))
    ]
    assert one_step[1] < one_step[0]
    assert one_step[1] == pytest.approx(best.cost, abs=1.0)


@pytest.mark.slow
def test_a_search_ends_within_a_unit_of_likelihood_and_refining_leaves_nothing(one, nominal):
    study, effect = one, EFFECTS["stribeck"]()
    rough = fit_model(study, (effect,), nominal.values)
    whole = refine_model(study, rough, (effect,))
    again = refine_model(study, whole, (effect,))
    assert 0 <= rough.cost - whole.cost < 5.0
    assert whole.cost - again.cost < 0.1


@pytest.mark.slow
@given(N=st.integers(70, 400), stride=st.sampled_from([2, 8, 12, 16]), n=st.integers(1, 3))
def test_averages_are_those_of_the_windows(N, stride, n):
    dt = 1 / (ROW_RATE * stride)
    windows = row_windows(N, stride)
    motion = SmoothedMotion(
        np.arange(N) * dt, *(np.zeros((0, N)) for _ in range(4)), True, windows,
        np.ones(windows.shape[0], dtype=bool), dt, np.zeros(0), 0.0, "made",
    )  # fmt: skip
    rows = np.random.default_rng(N).normal(size=(n, N))
    np.testing.assert_allclose(motion.averaged(rows), (windows @ rows.T).T, atol=1e-14)
    np.testing.assert_allclose(motion.averaged(rows[0]), windows @ rows[0], atol=1e-14)
