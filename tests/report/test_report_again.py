"""A report written again from its result file: the same answer, without the records."""

import importlib.util
import json
import math
import re
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import pneumo_casadi as pc
from pneumo_casadi.cli import app as cli
from pneumo_casadi.data import Finding, Grade
from pneumo_casadi.design import Distance
from pneumo_casadi.diagnosis import Condition, RegimeKind, Value, Verdict, read_diagnosis
from pneumo_casadi.diagnosis.metrics.findings import SensorError
from pneumo_casadi.diagnosis.result.plain_evidence import evidence_dict, evidence_of
from pneumo_casadi.errors import CaseError
from pneumo_casadi.identification.compared_model import Estimate
from pneumo_casadi.identification.read_comparison import read_comparison
from pneumo_casadi.identification.warnings import simulation_sentence
from pneumo_casadi.report.pages.again import write_report_again
from pneumo_casadi.report.pages.comparison import comparison_html
from pneumo_casadi.report.pages.design import write_design
from pneumo_casadi.report.pages.diagnosis import write_diagnosis
from pneumo_casadi.report.pages.diagnosis_figures import diagnosis_figures
from pneumo_casadi.report.pages.write import (
    write_comparison,
    write_identification,
    write_validation,
)
from pneumo_casadi.runtime.json_files import write_json
from pneumo_casadi.valve import FlowForm, FormSelection

_spec = importlib.util.spec_from_file_location(
    "diagnoses", Path(__file__).with_name("diagnoses.py")
)
made = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(made)


@dataclass(frozen=True)
class Still:
    """A figure whose files are there already: what a page does with pictures is not drawing."""

    name: str
    caption: str

    def png(self):
        return b"\x89PNG"

    def svg(self):
        return b'<svg width="9pt" height="9pt"></svg>'

    def files(self):
        return {"png": self.png(), "svg": self.svg()}


ORIGIN = {
    "made": "2026-11-24T10:40:00+00:00",
    "versions": {"numpy": "2"},
    "platform": "Linux",
    "sha256": {"bench.json": "0123"},
    "records": [
        {
            "name": "validate",
            "use": "held out",
            "duration": 10.0,
            "rate": 1000.0,
            "ranges": {"x": [-0.1, 0.1], "v": [-0.52, 0.5]},
        }
    ],
    "options": {},
}


@pytest.fixture(autouse=True)
def blank_figures(monkeypatch, leave_blank):
    """Leave the figures of pages blank: what is tested is what stands beside them."""
    leave_blank(monkeypatch, "png")


@pytest.fixture(scope="module")
def written(quick, tmp_path_factory):
    monkeypatch = pytest.MonkeyPatch()
    monkeypatch.setattr("pneumo_casadi.report.pages.write._figures_of", lambda result: ())
    folder = write_identification(quick, tmp_path_factory.mktemp("again") / "report")
    monkeypatch.undo()
    return folder


@pytest.mark.slow
def test_the_answer_is_that_of_the_first_report(written, tmp_path):
    folder = shutil.copytree(written, tmp_path / "copy")
    first = (folder / "report.html").read_text("utf-8")
    (folder / "report.html").unlink()
    assert cli.run(["report", str(folder)]) == 0
    again = (folder / "report.html").read_text("utf-8")
    for part in ("Piston area S", "Sonic conductance C", "Moving mass M", "<dt>Next</dt>"):
        at, there = first.index(part), again.index(part)
        assert first[at : at + 200] == again[there : there + 200]
    for part in (">X_s3</th>", ">f_v</th>", ">k_P</th>"):
        at, there = first.index(part), again.index(part)
        assert (
            first[at:].partition(' data-label="truth">')[0]
            == (again[there:].partition(' data-label="truth">')[0])
        )
    assert 'class="plot' in again


def test_a_result_file_alone_is_enough(written, tmp_path):
    shutil.copy(written / "result.json", tmp_path / "result.json")
    page = write_report_again(tmp_path / "result.json").read_text("utf-8")
    assert "Piston area S" in page and 'class="plot' not in page


def test_other_files_are_refused_in_one_line(written, tmp_path, capsys):
    content = json.loads((written / "result.json").read_text("utf-8"))
    del content["wls"]
    (tmp_path / "result.json").write_text(json.dumps(content), "utf-8")
    assert cli.run(["report", str(tmp_path)]) == 2
    assert "no complete result" in capsys.readouterr().err
    assert not (tmp_path / "report.html").exists()
    shutil.copy(written / "result.json", tmp_path / "result.json")
    (tmp_path / "report.html").write_text("that of a diagnosis")
    assert cli.run(["report", str(tmp_path)]) == 2
    assert "would be lost" in capsys.readouterr().err
    assert (tmp_path / "report.html").read_text() == "that of a diagnosis"


@pytest.mark.parametrize(
    "name",
    [
        "effect",
        "ambiguous",
        "none",
        "absorbed",
        "absorbed_in_n",
        "unknown",
        "curves",
        "besides",
        "corrections",
        "beside_absorbed",
    ],
)
def test_a_diagnosis_is_read_back_as_it_was_written(name, tmp_path):
    others = {
        "curves": made.with_curves,
        "besides": lambda: made.BESIDES,
        "corrections": lambda: made.CORRECTED,
        "beside_absorbed": lambda: made.BESIDE_ABSORBED,
        "absorbed_in_n": lambda: made.ABSORBED_IN_N,
    }
    diagnosis = others[name]() if name in others else made.ALL[Verdict(name)]
    write_json(diagnosis.as_dict(), tmp_path / "diagnosis.json")
    assert read_diagnosis(tmp_path).as_dict() == diagnosis.as_dict()


def test_what_json_cannot_hold_is_read_back(tmp_path):
    finding = Finding(
        Grade.SEVERE, "unit", "p", "`p` is in bar.", "bench.json", {"p_Pa": 7e5}, "identify"
    )
    band = replace(
        made.EFFECT.where.regimes[0], condition=Condition(RegimeKind.BAND, lower=8.0, chamber="P")
    )
    sensor = SensorError("position", 0.4)
    where = replace(
        made.EFFECT.where, regimes=(band,), sensor_error=sensor, effects=("hose",), rivals=("a",)
    )
    flow = FormSelection.given(FlowForm.POLYNOMIALS, (7, 7, 4))
    nominal = {"M": Value(16.9, math.nan, "kg")}
    diagnosis = replace(
        made.UNDECIDED, findings=(finding,), where=where, flow_selection=flow, nominal=nominal
    )
    write_json(diagnosis.as_dict(), tmp_path / "diagnosis.json")
    again = read_diagnosis(tmp_path / "diagnosis.json")
    assert again.as_dict() == diagnosis.as_dict()
    assert (again.findings, again.where, again.flow_selection) == ((finding,), where, flow)
    assert math.isnan(again.nominal["M"].std)


def test_the_curves_of_a_diagnosis_are_read_back():
    evidence = made.evidence()
    plain = json.loads(json.dumps(evidence_dict(evidence), allow_nan=False))
    again = evidence_of(plain)
    assert evidence_dict(again) == plain
    np.testing.assert_allclose(again.inputs[0].std, evidence.inputs[0].std, rtol=1e-5)
    np.testing.assert_array_equal(again.inputs[0].counts, evidence.inputs[0].counts)
    plain["unknown_inputs"][0]["w"].pop()
    with pytest.raises(ValueError, match="shape"):
        evidence_of(plain)


@pytest.fixture(scope="module")
def diagnosed(quick, tmp_path_factory):
    folder = tmp_path_factory.mktemp("again") / "diagnosis"
    monkeypatch = pytest.MonkeyPatch()  # one figure a kind is enough, and drawing takes seconds
    drawn = {each.name: each.caption for each in diagnosis_figures(made.with_curves())}
    few = [Still(name, drawn[name]) for name in ("validation_held_out", "discovered_term")]
    monkeypatch.setattr("pneumo_casadi.report.pages.diagnosis._figures_of", lambda result: few)
    told = replace(made.with_curves(), provenance=ORIGIN)
    yield write_diagnosis(told, folder, refined=quick)
    monkeypatch.undo()


@pytest.mark.slow
def test_the_report_of_a_diagnosis_is_written_again(diagnosed, tmp_path):
    folder = shutil.copytree(diagnosed, tmp_path / "copy")
    first = (folder / "report.html").read_text("utf-8")
    assert cli.run(["report", str(folder)]) == 0
    again = (folder / "report.html").read_text("utf-8")

    def fixed(page):
        """Return a page without the points of curves, which are rounded."""
        page = re.sub(r'<script type="application/json">.*?</script>', "", page, flags=re.DOTALL)
        return re.sub(r'src="data:[^"]*"', "", page)

    assert fixed(again) == fixed(first)
    assert again.count('class="plot') == first.count('class="plot') == 1
    final = again.partition('<h2 id="final">')[2]
    M = f"{diagnosed_mass(folder):.2f}"
    assert M in final.partition("</section>")[0] and "sha256 0123" in final
    assert "Made 2026-11-24 10:40:00 UTC with numpy 2, on Linux" in final
    for cell in ("held out", "10 s", "1000 Hz", "−100 to 100", "−520 to 500"):
        assert f">{cell}</td>" in final.replace("\xa0", " "), cell
    head = again.partition("</section>")[0]
    assert "Parameters usable" in head and M in head.partition("Moving mass M")[2]


def diagnosed_mass(folder):
    content = json.loads((folder / "result.json").read_text("utf-8"))
    return content["output_error"]["parameters"]["M"]["value"]


def test_a_diagnosis_without_its_curves_has_a_report(diagnosed, tmp_path):
    shutil.copy(diagnosed / "diagnosis.json", tmp_path / "diagnosis.json")
    page = write_report_again(tmp_path / "diagnosis.json").read_text("utf-8")
    assert "Stribeck friction explains" in page and 'class="plot' not in page


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c.pop("format"), "`format`"),
        (lambda c: c["gap"].update(before="12.7 %"), "`gap.before`: expected a number"),
        (lambda c: c["where"].update(junction="elsewhere"), "elsewhere"),
        (lambda c: c["where"]["regime_details"][0]["condition"].update(kind="os"), "'os'"),
        (lambda c: c["discovered"].update(driver="__import__"), "no driver '__import__'"),
        (lambda c: c["discovered"]["curve"]["value"].pop(), "differ in length"),
    ],
)
def test_a_diagnosis_that_was_changed_is_refused_with_the_field(change, words, tmp_path, capsys):
    content = made.with_curves().as_dict()
    change(content)
    write_json(content, tmp_path / "diagnosis.json")
    assert cli.run(["report", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert words in told and "diagnosis.json: no complete diagnosis" in told
    assert "diagnose the case again" in told
    assert [path.name for path in tmp_path.iterdir()] == ["diagnosis.json"]


@pytest.mark.slow
def test_a_comparison_is_read_back_and_its_report_written_again(
    quick_comparison, without_figures, tmp_path
):
    held = {"M": (Estimate(16.9, math.inf, "kg"), None)}
    estimates = dict(quick_comparison.estimates) | held
    odd = replace(quick_comparison, estimates=estimates, curves=quick_comparison.curves[:1])
    shares = []
    folder = write_comparison(odd, tmp_path / "comparison", lambda _, s: shares.append(s))
    assert shares[0] == 0.0 and shares[-1] == 1.0  # from the first figure to the page
    again = read_comparison(folder)
    assert again.as_dict() == odd.as_dict() and again.estimates["M"] == held["M"]
    first = (folder / "report.html").read_text("utf-8")
    (folder / "report.html").unlink()
    assert cli.run(["report", str(folder)]) == 0
    page = (folder / "report.html").read_text("utf-8")
    assert page.partition('<div class="plot')[0] == first.partition('<div class="plot')[0]
    assert page.count('class="plot') == len(odd.curves) > 0


def test_a_comparison_that_was_changed_is_refused_with_the_field(quick_comparison, tmp_path):
    content = quick_comparison.as_dict()
    content["differences"][0]["sigmas"] = "many"
    write_json(content, tmp_path / "comparison.json")
    with pytest.raises(CaseError, match=r"comparison.json: .*differences\[0\].sigmas"):
        read_comparison(tmp_path)
    del content["parameters"]["M"][quick_comparison.names[0]]
    content["differences"] = []
    write_json(content, tmp_path / "comparison.json")
    with pytest.raises(CaseError, match=r"parameters.M"):
        read_comparison(tmp_path)


@pytest.mark.slow
def test_a_validation_has_a_report_that_is_written_again(quick, without_figures, tmp_path):
    shares = []
    validated = quick.validation
    folder = write_validation(validated, tmp_path / "validation", lambda _, s: shares.append(s))
    assert shares[0] == 0.0 and shares[-1] == 1.0
    first = (folder / "report.html").read_text("utf-8")
    sentence = simulation_sentence(quick.validation)
    assert sentence[1:] in first.replace("\N{NO-BREAK SPACE}", " ")
    (folder / "report.html").unlink()
    assert cli.run(["report", str(folder)]) == 0
    again = (folder / "report.html").read_text("utf-8")
    assert again.partition('<div class="plot')[0] == first.partition('<div class="plot')[0]
    assert again.count('class="plot') == len(quick.validation.runs) > 0
    for page in (first, again):
        assert f"pneumo_casadi {pc.__version__}" in page
        assert "Records and the ranges that they cover" in page


@pytest.mark.slow
def test_a_comparison_says_where_it_comes_from(quick_comparison):
    """Which records, with which versions, and the hashes of the data of each result."""
    page = comparison_html(replace(quick_comparison, curves=quick_comparison.curves[:1]), [])
    assert f"pneumo_casadi {pc.__version__}" in page
    assert f"{quick_comparison.names[1]}: bench.json: sha256" in page.replace(
        "\N{NO-BREAK SPACE}", " "
    )
    assert f"simulated, of {quick_comparison.names[0]}" in page


@pytest.mark.slow
@pytest.mark.parametrize(
    "damaged",
    [
        {"versions": "2"},
        {"versions": {}, "sha256": {}, "options": {}, "records": [{"name": "identify"}]},
    ],
)
def test_damaged_provenance_is_named_and_the_report_stays(diagnosed, tmp_path, capsys, damaged):
    folder = shutil.copytree(diagnosed, tmp_path / "copy")
    before = (folder / "report.html").read_bytes()
    content = json.loads((folder / "diagnosis.json").read_text("utf-8"))
    write_json(content | {"provenance": damaged}, folder / "diagnosis.json")
    assert cli.run(["report", str(folder)]) == 2
    assert "diagnosis.json: no complete result" in capsys.readouterr().err.replace("\n", " ")
    assert (folder / "report.html").read_bytes() == before


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"precision": None, "distances": (Distance("hose", "none", 3.0, 9.0, 100),)},
    ],
)
def test_a_design_is_written_again_from_its_file(
    tmp_path, made_design, changes, monkeypatch, leave_blank
):
    leave_blank(monkeypatch, "svg")
    shares = []
    folder = write_design(made_design(**changes), tmp_path / "next", lambda _, s: shares.append(s))
    assert shares[0] == 0.0 and shares[-1] == 1.0  # the figure is part of the work
    report = folder / "report.html"
    first = report.read_bytes()
    report.unlink()
    assert write_report_again(folder) == report
    assert report.read_bytes() == first
    (folder / "design.json").write_text('{"precision": null}')
    with pytest.raises(CaseError, match="design the experiment again"):
        write_report_again(folder)
