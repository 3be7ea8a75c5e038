"""Manual commands: nothing is known of a controller, and no reference is recorded."""

import json

import pytest

import pneumo_casadi as pc
from pneumo_casadi.data import NoController
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.output_error import OutputErrorOptions
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.identification.trajectory_file import simulate_case
from pneumo_casadi.valve import FlowForm

pytest.importorskip("numba")


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    from pneumo_casadi.virtual_bench import Laboratory, make_case

    laboratory = Laboratory(controller=NoController(), reference=False)
    folder = tmp_path_factory.mktemp("manual") / "case"
    return make_case(folder, 1, duration=2.0, laboratory=laboratory)


@pytest.mark.slow
def test_an_axis_under_manual_commands_is_identified_in_open_loop_only(case, tmp_path):
    options = IdentifyOptions(FlowForm.ISO6358, windows=(0.5,))
    result = pc.identify(case.case, options)
    assert result.axis.parameters["M"].value == pytest.approx(case.axis.M, rel=0.005)
    assert result.validation.closed_loop is None
    assert all(run.closed_loop is None for run in result.validation.runs)
    content = json.loads(json.dumps(result_dict(result)))
    assert content["validation"]["closed_loop"] is None
    assert "closed loop" not in result.summary().lower()
    (open_loop,) = simulate_case(result.axis, case.case, closed_loop=False)
    assert open_loop.trajectory["x"].size == case.case.validate[0].N
    with pytest.raises(ModelError, match="no controller is known"):
        simulate_case(result.axis, case.case, closed_loop=True)


def test_a_closed_loop_fit_without_a_controller_is_refused(case):
    options = IdentifyOptions(
        FlowForm.ISO6358, output_error=OutputErrorOptions(closed_loop=True), windows=()
    )
    with pytest.raises(ModelError, match="no controller is known"):
        pc.identify(case.case, options)
