"""Two valves with maps of their own."""

import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import pneumo_casadi as pc
from pneumo_casadi.data import write_case
from pneumo_casadi.errors import CaseError
from pneumo_casadi.identification.model_file import axis_dict, axis_from_dict
from pneumo_casadi.identification.read_result import read_axis
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.identification.warnings.flow_map import flow_map_warnings
from pneumo_casadi.valve import read_flow_map
from pneumo_casadi.valve.flow_pair import FlowMapPair

FACTOR = 1.2  # by which the flow meter of chamber N's valve shows more


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    source = pc.example_case()
    table = pd.read_csv(source.flow_map_path)
    maps = [table, table.assign(q_m_kg_per_s=FACTOR * table.q_m_kg_per_s)]
    P, N = ({name: part[name].to_numpy() for name in part} for part in maps)
    folder = tmp_path_factory.mktemp("two") / "valves"
    record = source.identify[0].window(6.0, 8.0)
    return write_case(folder, source.bench, [record], flow_map=P, flow_map_N=N)


@pytest.fixture(scope="module")
def identified(case):
    return pc.identify(pc.read_case(case.folder))


@pytest.mark.slow
def test_each_valve_gives_its_chamber_the_scale(identified):
    truth = json.loads((pc.data.EXAMPLE / "truth.json").read_text())
    estimate = identified.output_error.parameters
    for i in range(1, 7):
        expected = truth[f"X_s{i}"] * (1.0 if i <= 3 else FACTOR)
        assert estimate[f"X_s{i}"].value == pytest.approx(expected, rel=0.015)
    assert estimate["M"].value == pytest.approx(truth["M"], rel=0.005)


@pytest.mark.slow
def test_the_result_is_read_back_on_its_case_and_by_itself(identified, case, tmp_path):
    path = tmp_path / "result.json"
    path.write_text(json.dumps(result_dict(identified)))
    expected = identified.axis.parameters.as_dict()
    assert read_axis(path, pc.read_case(case.folder)).parameters.as_dict() == expected
    assert axis_from_dict(axis_dict(identified.axis)).parameters.as_dict() == expected


def test_one_map_of_two_is_not_enough(case, tmp_path):
    for name in ("bench.json", "identify.csv.gz", "flow_map_P.csv"):
        (tmp_path / name).write_bytes((case.folder / name).read_bytes())
    with pytest.raises(CaseError, match=r"flow_map_N\.csv: no such file; give the map of both"):
        pc.read_case(tmp_path)


def test_each_valve_is_held_against_its_own_map(case):
    """Chamber N's map is metered less far: that says nothing of chamber P."""
    record = case.identify[0]
    P = read_flow_map(case.folder / "flow_map_P.csv")
    N = P.select(P.p < np.median(record["p_P"]))
    refined = SimpleNamespace(flow_parameters=("k_supply",), free_names=("k_supply",))
    fit = SimpleNamespace(flow_map_deviation=None, axis=refined, parameters=refined)
    found = list(flow_map_warnings([record], FlowMapPair(P, N), fit))
    assert [warning.text.split()[0] for warning in found] == ["p_N"]
    assert list(flow_map_warnings([record], FlowMapPair(P, P), fit)) == []
