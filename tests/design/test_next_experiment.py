"""What a design refuses before it searches."""

from dataclasses import replace

import pytest

import pneumo_casadi as pc
from pneumo_casadi.data import CascadeController, NoController, PidController
from pneumo_casadi.errors import ModelError


@pytest.mark.parametrize(
    "controller", [PidController(2.0, 5.0), CascadeController(6.0, 2.0, 5.0), NoController()]
)
def test_a_controller_that_is_not_proportional_is_refused_with_the_remedy(quick, controller):
    case = replace(quick.case, bench=replace(quick.case.bench, controller=controller))
    words = rf"not for a {type(controller).__name__}; state in bench\.json .*gain_V_per_m"
    with pytest.raises(ModelError, match=words):
        pc.design_experiment(replace(quick, case=case))
