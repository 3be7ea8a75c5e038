"""A report written again from its result file: the same answer, without the records."""

import json
import shutil

import pytest

from pneumo_casadi.cli import app as cli
from pneumo_casadi.report.pages.again import write_report_again
from pneumo_casadi.report.pages.write import write_identification


@pytest.fixture(scope="module")
def written(quick, tmp_path_factory):
    monkeypatch = pytest.MonkeyPatch()
    monkeypatch.setattr("pneumo_casadi.report.pages.write._figures_of", lambda result: ())
    folder = write_identification(quick, tmp_path_factory.mktemp("again") / "report")
    monkeypatch.undo()
    return folder


def test_the_answer_is_that_of_the_first_report(written, tmp_path):
    folder = shutil.copytree(written, tmp_path / "copy")
    first = (folder / "report.html").read_text("utf-8")
    (folder / "report.html").unlink()
    assert cli.run(["report", str(folder)]) == 0
    again = (folder / "report.html").read_text("utf-8")
    for part in ("Piston area S", "Sonic conductance C", "Moving mass M"):
        at, there = first.index(part), again.index(part)
        assert first[at : at + 200] == again[there : there + 200]
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
