"""The screen: in which directions it looks."""

import numpy as np
import pytest

from pneumo_casadi.diagnosis import prepare_study
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.diagnosis.screen.background import background
from pneumo_casadi.diagnosis.screen.directions import perturbation
from pneumo_casadi.diagnosis.screen.screen import screened
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.residuals import balance_residuals


@pytest.fixture(scope="module")
def study(made_case):
    return prepare_study(made_case(12, flow_map_shape="large"))[0]


@pytest.mark.slow
def test_an_effect_with_memory_is_screened_at_its_usual_size_too(study):
    """Play that is wider than most strokes of the command holds the spool; narrow play delays."""
    nominal = fit_model(study, ())
    directions = perturbation(study, nominal, EFFECTS["valve_hysteresis"]())
    narrow, usual = (each for each in directions if each.values == {"valve_hysteresis.s": 0.5})
    axis = study.axis.with_effects(EFFECTS["valve_hysteresis"]())
    axis = axis.with_parameters(dict(nominal.values)).at_null_values()
    model, name = BalanceFunctions(axis), "valve_hysteresis.h"
    h = axis.at_starting_values().parameters[name].value
    changes = []
    for size in (1e-3 * axis.parameters[name].scale, h):
        theta = axis.with_parameters({name: size}).parameters.values
        rows = [
            (
                balance_residuals(model, data, theta)
                - balance_residuals(model, data, axis.parameters.values)
            )[data.used(study.axis)]
            for data in study.smoothed[0]
        ]
        changes.append(np.concatenate(rows))
    for direction, change in zip((narrow, usual), changes, strict=True):
        column = direction.columns[: change.size, 0]
        assert column @ change > 0.9 * np.linalg.norm(column) * np.linalg.norm(change)
    apart = narrow.columns[:, 0] @ usual.columns[:, 0]
    assert apart < 0.95 * np.prod(
        [np.linalg.norm(direction.columns) for direction in (narrow, usual)]
    )


@pytest.mark.slow
def test_an_effect_without_memory_is_screened_by_its_tangent_alone(study):
    nominal = fit_model(study, ())
    assert len(perturbation(study, nominal, EFFECTS["spring_load"]())) == 1


@pytest.mark.slow
def test_what_an_effect_promises_is_the_sum_of_what_it_promises_in_each_balance(study):
    """Friction in the force alone, a shape of the valve in the flows."""
    nominal = fit_model(study, ())
    behind = background(study, nominal, nominal)
    friction, shape = (
        screened(name, perturbation(study, nominal, EFFECTS[name]()), behind)
        for name in ("asymmetric_viscous_friction", "flow_map_shape")
    )
    assert friction.by_balance.sum() == pytest.approx(friction.gain, rel=0.05)
    assert friction.gain > 0 and np.abs(friction.by_balance[:2]).max() < 0.05 * friction.gain
    assert shape.by_balance[:2].min() > 10 * abs(shape.by_balance[2])
