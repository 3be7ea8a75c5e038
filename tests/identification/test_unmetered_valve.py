"""An axis whose valve nobody metered: areas give the scale, the records the rest."""

import re
from dataclasses import replace
from types import SimpleNamespace

import pytest

import pneumo_casadi as pc
from pneumo_casadi.data import FlowSource, ValveData, Valves
from pneumo_casadi.errors import ModelError
from pneumo_casadi.identification.warnings.flow_map import flow_map_warnings
from pneumo_casadi.model.servosystem import Servosystem
from pneumo_casadi.valve import iso6358_from_data_sheet

WRONG_SHEET = ValveData(FlowSource.DATA_SHEET, None, 1e-8, 1.9e-8, 0.4, u_full=5.0)


def without_map(valve):
    """The example at 1 kHz, a fifth of its samples, without its map."""
    case = pc.example_case()
    record = case.identify[0].window(4.0, 8.0).decimate(5, average=("u_P", "u_N"))
    bench = replace(case.bench, sampling_frequency=1000.0, valves=Valves(valve, valve))
    return replace(case, bench=bench, identify=(record,), flow_map_path=None, validate=())


@pytest.mark.slow
@pytest.mark.parametrize("valve", [ValveData(FlowSource.NONE), WRONG_SHEET], ids=["none", "sheet"])
def test_parameters_are_found_without_a_flow_map(valve):
    result = pc.identify(without_map(valve))
    frame = result.to_frame()
    error = frame.output_error / frame.truth - 1
    std = frame.output_error_std / frame.truth
    for name in (f"X_s{i}" for i in range(1, 7)):
        assert abs(error[name]) < min(0.02, 2.5 * std[name]), name
        # One per cent of each area is one over the root of two of their common factor.
        assert std[name] > 0.007
        assert result.wls.std_hac[result.wls.names.index(name)] / frame.wls[name] > 0.007
    assert abs(error["M"]) < 0.005
    assert not any(warning.grade == "severe" for warning in result.warnings)


@pytest.mark.parametrize(
    ("factor", "grade"), [(0.1, "severe"), (0.45, "caution"), (1.4, None), (2.5, "caution")]
)
def test_a_data_sheet_that_the_records_contradict_is_named(factor, grade):
    bench = without_map(WRONG_SHEET).bench
    axis = Servosystem(bench, iso6358_from_data_sheet(bench, WRONG_SHEET))
    fitted = axis.with_parameters({"k_supply": factor * axis.parameters["k_supply"].value})
    found = list(flow_map_warnings((), None, SimpleNamespace(axis=fitted)))
    assert [warning.grade for warning in found] == [grade] * (grade is not None)
    if found:
        told = re.match(
            r"The records need (\S+) times the flow that C_fill = 1e-08 ", found[0].text
        )
        assert float(told[1]) == pytest.approx(factor, rel=0.1)


def test_a_case_without_a_map_says_what_to_write():
    case = replace(pc.example_case(), flow_map_path=None)
    with pytest.raises(ValueError, match=r'no flow_map.csv, .*write "valve": {"source": "none"}'):
        pc.identify(case)


def test_a_flow_that_was_not_metered_is_not_held():
    with pytest.raises(ModelError, match="no valve was metered"):
        pc.identify(without_map(ValveData(FlowSource.NONE)), pc.IdentifyOptions(refine_flow=False))
