"""The check of a case: figures of the record are right, and what is lacking is recorded next."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

import pneumo_casadi as pc
from pneumo_casadi.cli import app as cli
from pneumo_casadi.data import (
    EXAMPLE,
    FlowSource,
    Grade,
    InputHold,
    PressureBench,
    Recording,
    ValveData,
    Valves,
)


@pytest.fixture(scope="module")
def case():
    return pc.example_case()


@pytest.fixture(scope="module")
def result(case):
    return pc.check(case)


def lacking(result):
    return {statement.about for statement in result.statements if not statement.enough}


def test_the_example_is_good_and_lacks_nothing(result):
    assert result.findings == () and result.usable and lacking(result) == set()
    assert result.record_next == () and "common mistakes" in result.headline


def test_the_noise_is_that_of_the_bench(result, case):
    for content in result.contents:
        assert content.noise["x"] == pytest.approx(case.bench.noise.x, rel=0.03)
        assert content.noise["p_P"] == pytest.approx(case.bench.noise.p, rel=0.03)


def test_noise_stated_wrongly_is_a_caution_with_the_value_wherever_the_case_is_read(tmp_path):
    folder = tmp_path / "case"
    shutil.copytree(EXAMPLE, folder)
    content = json.loads((folder / "bench.json").read_text("utf-8"))
    content["sensor_noise"] = {"p_Pa": 1500.0, "x_m": 1.5e-5}
    (folder / "bench.json").write_text(json.dumps(content), "utf-8")
    result = pc.check(folder)
    assert {finding.name for finding in result.findings} == {"stated noise"} and result.usable
    noise = result.findings[0].suggestion["sensor_noise"]
    assert noise["p_Pa"] == pytest.approx(150, rel=0.03) and noise["x_m"] == 1.5e-5
    assert pc.read_case(folder).findings == result.findings  # `identify` repeats them


def test_a_short_slow_record_says_what_to_record_next(case):
    record = case.identify[0].window(5.0, 7.0)
    slow = record.with_channels({"x": record["x"][0] + 0.02 * (record["x"] - record["x"][0])})
    result = pc.check(replace(case, identify=(slow,), validate=()))
    assert {"all parameters", "accuracy of predictions", "M"} <= lacking(result)
    assert "move over the whole stroke" in result.record_next
    assert any("validate.csv" in advice for advice in result.record_next)


def test_a_travel_of_a_few_per_cent_of_the_stroke_questions_the_unit(case):
    record = case.identify[0]
    for share, questioned in ((0.05, True), (0.2, False)):
        small = {name: share * record[name] for name in ("x", "x_ref")}
        result = pc.check(replace(case, identify=(record.with_channels(small),), validate=()))
        texts = [statement.text for statement in result.statements]
        assert any("; is x in its right unit?" in text for text in texts) is questioned


def test_motion_in_one_direction_cannot_tell_the_friction_of_the_other(case):
    record = case.identify[0]
    forward = record.with_channels({"x": 1e-2 * (record.t - record.t[0]) + 1e-3 * np.sin(record.t)})
    assert "F_c_plus, F_c_minus" in lacking(pc.check(replace(case, identify=(forward,))))


def test_the_summary_begins_with_the_headline_and_shows_each_record(result):
    text = result.summary()
    assert text.startswith(result.headline) and "identify" in text and "validate" in text
    assert max(len(line) for line in text.splitlines()) <= 100


def test_the_command_prints_the_check_and_writes_json(tmp_path, capsys):
    assert cli.run(["check", str(EXAMPLE), "--json", str(tmp_path / "check.json"), "--strict"]) == 0
    assert capsys.readouterr().out.startswith("Check of table1: none of the common mistakes")
    content = json.loads((tmp_path / "check.json").read_text("utf-8"))
    assert content["usable"] is True and content["records"][0]["duration_s"] == 10.0


def test_a_refused_record_is_checked_all_the_same(tmp_path, case, capsys):
    record = case.identify[0].window(5.0, 7.0)
    bar = record.with_channels({name: 1e-5 * record[name] for name in ("p_P", "p_N")})
    pc.write_case(tmp_path / "case", case.bench, [bar])
    assert cli.run(["check", str(tmp_path / "case")]) == 0
    assert cli.run(["check", str(tmp_path / "case"), "--strict"]) == 3
    out = capsys.readouterr().out
    assert "is it in bar" in out and "The records can tell" in out


def test_a_missing_case_is_one_line(tmp_path, capsys):
    assert cli.run(["check", str(tmp_path / "nowhere")]) == 2
    assert "no such folder" in capsys.readouterr().err


def test_what_a_fit_would_refuse_is_told_by_the_check(case, case_folder, capsys):
    folder = case_folder()
    (folder / "truth.json").write_text('{"M": "heavy"}')
    assert cli.run(["check", str(folder)]) == 2
    assert "truth.json: `M`" in capsys.readouterr().err
    missing = pc.check(replace(case, flow_map_path=None))
    assert not missing.usable and 'write "valve": {"source": "none"}' in missing.headline


def test_a_map_that_the_bench_does_not_use_is_a_note_and_compared_with_nothing(case, tmp_path):
    unmetered = ValveData(FlowSource.NONE)
    bench = replace(case.bench, valves=Valves(unmetered, unmetered))
    part = case.identify[0].window(5.0, 7.0).decimate(5, average=("u_P", "u_N"))
    bench = replace(bench, sampling_frequency=1000.0)
    u, p = (grid.ravel() for grid in np.meshgrid([-5.0, 5.0], np.linspace(1e5, 7e5, 9)))
    table = {"u_V": u, "p_Pa": p, "q_m_kg_per_s": 1.0 * u}  # a valve a thousand times as large
    result = pc.check(pc.write_case(tmp_path / "case", bench, [part], flow_map=table).folder)
    (finding,) = result.findings
    assert (finding.grade, finding.name) == (Grade.NOTE, "map not used")
    assert "`flow_map.csv` is not used: bench.json does not say" in finding.text


def test_a_mass_driven_by_pressures_may_lie_beside_a_map(case, tmp_path):
    bench = PressureBench(1000.0, case.bench.S_P, case.bench.S_N, 0.5, case.bench.p_ext)
    part = case.identify[0].window(5.0, 7.0).decimate(5)
    channels = {name: part[name] for name in ("p_P", "p_N", "x")}
    part = Recording(part.t, channels, "mass", "memory", InputHold.LINEAR)
    folder = tmp_path / "case"
    pc.write_case(folder, bench, [part], flow_map=case.flow_map_path)
    findings = {finding.name: finding.text for finding in pc.check(folder).findings}
    assert "no valves" in findings["map not used"] and "map of another valve" not in findings
