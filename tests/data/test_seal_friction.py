"""The measurements of an O-ring: real clock, gaps, a force on the rod."""

import gzip
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pneumo_casadi.data import Clock, read_case, read_seal_friction
from pneumo_casadi.data.seal_friction import COLUMNS, FILES, P_EXT
from pneumo_casadi.diagnosis import diagnose
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import CaseError, ModelError
from pneumo_casadi.model.servosystem import PressureAxis

RESULT = Path(__file__).parents[2] / "benchmarks" / "results" / "seal_friction.json"


def write(folder, rows=200, columns=7):
    t = np.cumsum(np.full(rows, 10.0))
    t[rows // 2 :] += 300.0  # a gap
    table = np.zeros((rows, columns))
    table[:, 0] = t
    if columns == len(COLUMNS):
        table[:, 4:] = [12.0, 3.0, 160.0]
    for name in FILES.values():
        text = "\n".join("\t".join(f"{value:.3f}" for value in row) for row in table)
        (folder / name).write_bytes(gzip.compress(text.encode()))


def test_files_become_records_between_gaps_in_si_units(tmp_path):
    write(tmp_path)
    case = read_case(tmp_path)
    assert len(case.identify) == 6 and len(case.validate) == 2  # two stretches a file
    record = case.identify[0]
    assert record.clock is Clock.AS_RECORDED and record.N == 100
    assert record["p_P"][0] == pytest.approx(3e5 + P_EXT)
    assert record["x"][0] == pytest.approx(-0.012)
    assert record["F_load"][0] == pytest.approx(-160.0)
    assert case.bench.kind.inputs == ("p_P", "F_load")


def test_another_file_or_a_missing_one_is_refused(tmp_path):
    write(tmp_path, columns=3)
    with pytest.raises(CaseError, match=r"O-ring257_1bar\.tsv\.gz: "):
        read_seal_friction(tmp_path)
    (tmp_path / FILES[1]).unlink()
    with pytest.raises(CaseError, match="no such file; give the folder with the author's"):
        read_seal_friction(tmp_path)


def test_area_friction_over_pressure_and_the_force_at_the_withheld_pressure():
    result = json.loads(RESULT.read_text())
    for fit in ("measured_pressure", "mean_pressure"):
        assert result[fit]["S_P_cm2"]["value"] == pytest.approx(5.25, rel=0.02)
    # Half the force loop grows by 0.78 N/bar; a third of it is the regulator's own pressure.
    assert result["mean_pressure"]["k_p_N_per_bar"]["value"] == pytest.approx(0.78, rel=0.15)
    friction = result["measured_pressure"]["k_p_N_per_bar"]
    assert 10 * friction["std"] < friction["value"] < 0.75
    for direction in result["prediction_at_7_bar"].values():
        assert abs(direction["error_N"]) < 1.0


def test_the_cause_is_named_at_three_pressures_and_closes_the_gap_at_the_fourth():
    told = json.loads(RESULT.read_text())["diagnosis"]
    assert told["named"] == ["pressure_friction"] and told["probability"][0] > 0.9
    assert told["second"]["probability"] < 0.01
    # Half the force loop grows by 0.78 N/bar; the regulator's own pressure is part of that.
    assert 0.5 < told["k_p_N_per_bar"] < 0.78
    assert told["closes_of_force_balance"]["interval"][0] > 0.3
    assert told["gap_percent"]["after"] < 0.01 * told["gap_percent"]["before"]


@pytest.mark.data
@pytest.mark.slow
def test_records_too_slow_for_accelerations_are_diagnosed(data_folder):
    """At 100 Hz differences lose much of an acceleration; friction shows all the same."""
    case = read_seal_friction(data_folder / "seal_friction")
    few = {name: EFFECTS[name] for name in ("pressure_friction", "asymmetric_viscous_friction")}
    by_length = sorted(case.identify, key=lambda record: record.duration)[-3:]
    short = [
        record.window(float(record.t[0]) + 2.0, float(record.t[0]) + 14.0) for record in by_length
    ]
    held_out = case.validate[-1].window(10.0, 18.0)
    told = diagnose(replace(case, identify=tuple(short), validate=(held_out,)), few)
    assert [effect.name for effect in told.effects] == ["pressure_friction"]
    assert told.effects[0].parameters["k_p"].value == pytest.approx(0.68e-5, rel=0.15)


def test_an_effect_on_a_sensor_that_the_axis_has_not_is_refused(tmp_path):
    write(tmp_path)
    axis = PressureAxis(read_case(tmp_path).bench)
    with pytest.raises(ModelError, match="concerns the sensor of p_P, p_N, which is no output"):
        axis.with_effects(EFFECTS["pressure_sensor_bias"]())


@pytest.mark.data
def test_the_committed_figures_are_those_of_the_measurements(data_folder, script):
    made = script(RESULT.parents[1] / "seal_friction.py")
    figures = made.run(read_seal_friction(data_folder / "seal_friction"))
    committed = json.loads(RESULT.read_text())
    for fit in ("measured_pressure", "mean_pressure"):
        for name, item in figures[fit].items():
            assert committed[fit][name]["value"] == pytest.approx(item["value"], rel=1e-6)
