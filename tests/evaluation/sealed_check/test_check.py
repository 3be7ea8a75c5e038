"""The whole check with a diagnosis that always says the same, and with the command."""

import json

import numpy as np
import pytest

from pneumo_casadi.cli import app as cli
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import CaseError
from pneumo_casadi.evaluation.sealed_check import (
    Kind,
    Proportions,
    WithheldOptions,
    check,
    check_withheld,
    measure,
)
from pneumo_casadi.evaluation.sealed_check.draw import Draw, make
from pneumo_casadi.evaluation.sealed_check.largest import largest_of
from pneumo_casadi.evaluation.sealed_check.measure import measure_one, rivals_of_one
from pneumo_casadi.report.figures.studies.withheld import withheld_figure
from pneumo_casadi.report.figures.style import png
from pneumo_casadi.report.tables.sealed_check import withheld_table
from pneumo_casadi.report.text.identification import render
from pneumo_casadi.runtime.json_files import write_json

SHORT = {"duration": 2.0, "fs": 500.0, "background": 0.0}
OPTIONS = WithheldOptions(3, 3, Proportions(1, 0, 1, 0, 0, 1), **SHORT)


@pytest.fixture
def always(told):
    """A diagnosis that says Stribeck of everything."""
    calls = []

    def diagnosing(case, catalogue):
        calls.append(case.name)
        return told("effect", "stribeck", ranking=["stribeck", "hose"], probability=0.75)

    diagnosing.calls = calls
    return diagnosing


@pytest.fixture
def unmeasured(monkeypatch):
    """Leave out what takes fits."""

    def write(folder, case, draw, named, duration, fs):
        assert (case / "bench.json").is_file()
        write_json({"visible": bool(draw.effects)}, folder / f"{draw.name}.json")

    def ask(folder, case, draw):
        write_json({"by_error": ["stribeck"], "by_aic": []}, folder / f"{draw.name}.json")

    monkeypatch.setattr(check, "measure_one", write)
    monkeypatch.setattr(check, "rivals_of_one", ask)


@pytest.mark.slow
def test_a_diagnosis_that_always_says_stribeck_scores_as_it_must(
    tmp_path, always, in_place, unmeasured
):
    outcome = check_withheld(tmp_path, OPTIONS, in_place, always)
    stribeck = sum(case["effects"].keys() == {"stribeck"} for case in outcome["each"])
    scores = outcome["scores"]["all"]
    assert always.calls == ["w001", "w002", "w003"]
    assert (scores["right_first"]["hits"], scores["right_first"]["of"]) == (stribeck, 1)
    assert (scores["false_alarm"]["hits"], scores["false_alarm"]["of"]) == (1, 1)
    assert (scores["unknown_caught"]["hits"], scores["unknown_caught"]["of"]) == (0, 1)
    assert scores["set_size"] == {"mean": 1.0, "of": 1}
    assert outcome["calibration"]["expected_calibration_error"] == pytest.approx(
        abs(0.75 - stribeck / 4)
        if stribeck in (0, 4)
        else 0.25 * stribeck / 4 + 0.75 * (1 - stribeck / 4)
    )
    assert outcome["unmeasured"] == 0
    again = check_withheld(tmp_path, OPTIONS, in_place, always)
    assert again == outcome
    assert len(always.calls) == 3
    with pytest.raises(CaseError, match="another seed"):
        check_withheld(
            tmp_path, WithheldOptions(3, 4, OPTIONS.proportions, **SHORT), in_place, always
        )
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {
        *("seal.json", "labels.sealed", "opened.json", "scores.json"),
        *("cases", "verdicts", "measures", "rivals", ".pneumo_casadi.json"),
    }


@pytest.mark.slow
def test_a_large_cause_shows_and_an_oracle_removes_more_than_another_effect(tmp_path, monkeypatch):
    few = {name: EFFECTS[name] for name in ("stribeck", "quadratic_drag", "drive_lag")}
    monkeypatch.setattr(measure, "without_causes", lambda causes: few)
    draw = Draw("w001", Kind.SINGLE, 5, {"stribeck": "large"})
    case = make(draw, tmp_path / "case", duration=3.0, fs=500.0).folder
    measure_one(tmp_path, case, draw, ["quadratic_drag"], duration=3.0, fs=500.0)
    content = json.loads((tmp_path / "w001.json").read_text())
    assert content["visible"]
    assert content["rms"]["force"] > 3 * content["twin_rms"]["force"]
    assert 0 < content["named_shrink"] < content["oracle_shrink"] - 0.1
    assert content["oracle_shrink"] > 0.5
    rivals_of_one(tmp_path / "rivals", case, draw)
    content = json.loads((tmp_path / "rivals" / "w001.json").read_text())
    assert content["by_error"] == ["stribeck", "quadratic_drag"], "no drive on this axis"
    assert content["by_aic"][0] == "stribeck"


@pytest.mark.slow
def test_the_effect_with_the_largest_gap_is_measured_on_the_bench(tmp_path, monkeypatch):
    monkeypatch.setattr(measure, "without_causes", lambda causes: {"stribeck": EFFECTS["stribeck"]})
    draw = Draw("w001", Kind.SINGLE, 5, {"stribeck": "large"}, background=("quadratic_drag",))
    brief = {"duration": 2.0, "fs": 500.0}
    case = make(draw, tmp_path / "case", **brief).folder
    measure_one(tmp_path, case, draw, ["stribeck"], **brief)
    gaps = json.loads((tmp_path / "w001.json").read_text())["gap_without"]
    assert gaps.keys() == {"stribeck", "quadratic_drag"}
    assert largest_of(gaps) == "stribeck"
    assert gaps["stribeck"] < 0.7 * gaps["quadratic_drag"]


@pytest.mark.slow
def test_a_case_that_cannot_be_measured_says_why(tmp_path):
    draw = Draw("w001", Kind.NONE, 5, {})
    too_short = {"duration": 0.5, "fs": 500.0}
    measure_one(tmp_path, make(draw, tmp_path / "case", **too_short).folder, draw, [], **too_short)
    assert "too short" in json.loads((tmp_path / "w001.json").read_text())["failure"]


@pytest.mark.slow
def test_the_command_prints_the_scores_and_writes_them(tmp_path, monkeypatch, told, judged, capsys):
    from pneumo_casadi.evaluation import sealed_check

    cases = [
        judged("single", "hose", told("effect", "hose"), by_error=["hose"], by_aic=["hose"]),
        judged("none", "", told("none")),
    ]
    asked = []

    def in_no_time(folder, options, executor, progress):
        asked.append(options)
        folder.mkdir(exist_ok=True)
        return sealed_check.scored(cases)

    monkeypatch.setattr(sealed_check, "check_withheld", in_no_time)
    folder, file = tmp_path / "out", tmp_path / "scores.json"
    given = ["withheld", "--cases", "2", "-o", str(folder), "--json", str(file)]
    assert cli.run(given) == 0
    assert "single effects: named, and nothing else" in capsys.readouterr().out
    assert json.loads(file.read_text())["scores"]["all"]["right_first"]["hits"] == 1
    assert (folder / "withheld.png").stat().st_size > 10_000
    assert cli.run(given) == 0
    assert asked[0] == asked[1], "called again, it goes on with the seed of the folder"
    (folder / "seed.txt").write_text("seven")
    assert cli.run(given) == 2


def test_table_and_figure_show_a_check_without_visible_cases(told, judged):
    from pneumo_casadi.evaluation.sealed_check import scored

    scores = scored([judged("single", "hose", told("none"), visible=False)])
    text = render(withheld_table(scores))
    assert "0.0 (0-79) 0/1" in text
    assert np.frombuffer(png(withheld_figure(scores)), np.uint8).size > 10_000


def test_the_matrix_joins_effects_that_were_never_true(told, judged):
    from pneumo_casadi.evaluation.sealed_check import scored

    said_of = {"hose": "backlash", "stribeck": "elastic_load", "leakage_P": "stribeck"}
    cases = [judged("single", true, told("effect", name)) for true, name in said_of.items()]
    figure = withheld_figure(scored([*cases, judged("none", "", told("none"))]))
    matrix = figure.axes[0]
    assert [label.get_text() for label in matrix.get_xticklabels()] == [
        "1",
        "2",
        "3",
        "other",
        "none",
    ]
    assert sorted(text.get_text() for text in matrix.texts) == ["1"] * 4


def test_a_cause_shows_beside_the_other_where_more_is_left_with_it(monkeypatch):
    """Each is taken out in turn: what is left then is what it must exceed."""
    left = {"hose": np.array([1.0, 1.0]), "stribeck": np.array([2.9, 1.0])}
    monkeypatch.setattr(
        measure, "nominal_rms", lambda draw, folder, duration, fs: left[next(iter(draw.effects))]
    )
    draw = Draw("w001", Kind.PAIR, 1, {"hose": "large", "stribeck": "medium"})
    shown = measure.shows_beside(draw, {"mass_flow_P": 3.0, "force": 1.0}, 20.0, 1000.0)
    assert shown == {"hose": False, "stribeck": True}
