"""What a design refuses before it searches."""

from dataclasses import replace

import pytest

import pneumo_casadi as pc
from pneumo_casadi.data import Arrangement, CascadeController, NoController, PidController
from pneumo_casadi.errors import CaseError, ModelError


@pytest.mark.parametrize(
    "controller", [PidController(2.0, 5.0), CascadeController(6.0, 2.0, 5.0), NoController()]
)
def test_a_controller_that_is_not_proportional_is_refused_with_the_remedy(quick, controller):
    case = replace(quick.case, bench=replace(quick.case.bench, controller=controller))
    words = rf"not for a {type(controller).__name__}; state in bench\.json .*gain_V_per_m"
    with pytest.raises(ModelError, match=words):
        pc.design_experiment(replace(quick, case=case))


def test_one_valve_has_no_common_mode(quick):
    bench = replace(quick.case.bench, arrangement=Arrangement.ONE_5_3)
    changed = replace(quick, case=replace(quick.case, bench=bench))
    with pytest.raises(CaseError, match=r"5/3 valve .* no common mode; leave out `common`"):
        pc.design_experiment(changed, pc.ExperimentRequest(common=0.05, tries=1))


@pytest.mark.parametrize("given", [{"duration": 0.0}, {"duration": -1.0}, {"tries": 0}])
def test_a_design_of_nothing_is_refused(given):
    """A zero was taken for a default."""
    with pytest.raises(CaseError, match=f"{next(iter(given))}: .* leaves nothing to design"):
        pc.ExperimentRequest(**given)
