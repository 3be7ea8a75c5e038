"""What a refinement by output error leaves of a fit."""

from dataclasses import replace

import pytest

from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.diagnosis.select import output_error_refinement as module
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import FitError
from pneumo_casadi.estimation.equation_error.fit import (
    default_residual_floor,
    equation_error_costs,
)


def test_a_fit_that_output_error_does_not_better_costs_what_it_costs_where_it_begins(
    sound_study, monkeypatch
):
    """It begins with an effect more: it had the cost and the residuals of the smaller model."""

    def fail(*given):
        raise FitError("does not settle")

    monkeypatch.setattr(module, "fit_output_error", fail)
    nominal, effect = fit_model(sound_study, ()), EFFECTS["spring_load"]()
    axis = sound_study.axis.with_effects(effect).at_starting_values()
    axis = axis.with_parameters(dict(nominal.values))
    begin = replace(nominal, effects=(effect.name,), values=axis.parameters.as_dict(), pace=1.0)
    result = module.refine_by_output_error(sound_study, begin, (effect,))
    (cost,) = equation_error_costs(
        axis,
        [axis.parameters.values],
        sound_study.smoothed[0],
        sound_study.anchor,
        residual_floor=default_residual_floor(axis),
    )
    assert result.cost == pytest.approx(cost) and result.cost > nominal.cost + 1
    assert result.pace == 0.0  # it goes on in simulations, not in the balances
