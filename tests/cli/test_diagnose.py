"""``pneumo-casadi diagnose``: a folder with a verdict, or one line that says why not."""

import importlib
import importlib.util
import json
import os
import shutil
from pathlib import Path

import pandas as pd
import pytest

from pneumo_casadi.cli import app as cli
from pneumo_casadi.cli.diagnose import _refined
from pneumo_casadi.cli.parts.bar import time_left
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import CaseError, FitError, ModelError
from pneumo_casadi.runtime.processes import default_workers, processes
from pneumo_casadi.runtime.progress import no_progress

_spec = importlib.util.spec_from_file_location(
    "diagnoses", Path(__file__).parents[1] / "report" / "diagnoses.py"
)
made = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(made)

#: The module; as an attribute of its package the name is the function's.
MODULE = importlib.import_module("pneumo_casadi.diagnosis.diagnose")
REFINE = "pneumo_casadi.diagnosis.refined_identification.refine_diagnosis"
FILES = {"diagnosis.json", "report.html", "summary.txt", "figures", ".pneumo_casadi.json"}


def error_line(capsys) -> str:
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("error: "), lines
    return lines[0]


@pytest.fixture
def given(monkeypatch):
    """A diagnosis made by hand in the place of the search; what it was asked for."""
    asked = []

    def diagnose(case, catalogue, options, progress, executor):
        asked.append((case, catalogue, options, executor))
        progress("screening", 0.5)
        return made.EFFECT

    monkeypatch.setattr(MODULE, "diagnose", diagnose)
    return asked


@pytest.mark.slow
def test_a_case_folder_is_diagnosed_and_the_fits_are_kept(without_pictures, tmp_path, capsys):
    pytest.importorskip("numba")
    from pneumo_casadi.virtual_bench import make_case

    case = tmp_path / "case"
    make_case(case, 5, {"spring_load": "medium"}, fs=500.0, duration=2.0)
    others = [name for name in EFFECTS if name not in ("spring_load", "stribeck")]
    leave_out = [word for name in others for word in ("--without", name)]
    folder, copy, keep = tmp_path / "out", tmp_path / "copy.json", tmp_path / "fits"
    arguments = ["--workers", "1", "--keep", str(keep), "--json", str(copy), "-o", str(folder)]
    arguments += ["--flow", "iso6358"]  # comparing the forms is tested elsewhere
    assert cli.run(["diagnose", str(case), *leave_out, *arguments]) == 0
    assert {path.name for path in folder.iterdir()} >= {
        *FILES - {"figures"},
        "curves.json",
        "result.json",
    }
    found = json.loads((folder / "diagnosis.json").read_text("utf-8"))
    assert found["verdict"] == "effect"
    assert [one["name"] for one in found["effects"]] == ["spring_load"]
    assert found["gap"]["after"] < 0.2 * found["gap"]["before"]
    assert set(found["provenance"]["options"]["without"]) == set(others)
    assert "identify.csv.gz" in found["provenance"]["sha256"]
    assert json.loads(copy.read_text("utf-8"))["ranking"] == found["ranking"]
    final = json.loads((folder / "result.json").read_text("utf-8"))["output_error"]["parameters"]
    refined, first = final["spring_load.k"], found["effects"][0]["parameters"]["k"]
    assert refined["value"] == pytest.approx(first["value"], rel=0.1)
    assert any(keep.glob("*.npz"))
    printed = capsys.readouterr().out
    assert "Spring load explains the difference between model and measurement" in " ".join(
        printed.split()
    )
    assert (folder / "summary.txt").read_text("utf-8").strip() in printed


@pytest.mark.slow
def test_what_is_asked_for_reaches_the_diagnosis(short_example, without_pictures, tmp_path, given):
    folder = tmp_path / "out"
    arguments = ["--without", "hose", "--without", "backlash", "--keep", str(tmp_path / "fits")]
    arguments += ["--workers=1", "--no-refine"]
    assert cli.run(["diagnose", str(short_example), "-o", str(folder), *arguments]) == 0
    ((case, catalogue, options, executor),) = given
    assert case.name == short_example.name
    left_out = {name for name, effect in EFFECTS.items() if effect.cause in ("hose", "backlash")}
    assert len(left_out) > 2 and set(EFFECTS) - set(catalogue) == left_out
    assert options.keep == tmp_path / "fits"
    assert executor is None
    assert {path.name for path in folder.iterdir()} == FILES


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--without", "rust"], "no effect 'rust'"),
        ([word for name in EFFECTS for word in ("--without", name)], "leaves no effect"),
        (["--workers", "0"], "--help"),
        (["--strict", "--no-refine"], "no final model"),
    ],
)
def test_usage_errors_are_one_line_and_write_nothing(
    embedded, tmp_path, capsys, given, arguments, words
):
    assert cli.run(["diagnose", str(embedded), *arguments, "-o", str(tmp_path / "out")]) == 2
    assert words in error_line(capsys)
    assert not given and not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_record_too_short_is_refused_in_one_line(short_example, tmp_path, capsys):
    case = shutil.copytree(short_example, tmp_path / "case")
    frame = pd.read_csv(case / "identify.csv.gz").iloc[:2500]  # half a second
    frame.to_csv(case / "identify.csv.gz", index=False)
    out = tmp_path / "out"
    assert cli.run(["diagnose", str(case), "--workers", "1", "-o", str(out)]) == 2
    line = capsys.readouterr().err.splitlines()[-1]  # a warning of the reader stands above it
    assert line.startswith("error: ") and "identify.csv.gz" in line and "too short" in line
    assert not out.exists()


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (FitError("no step was found; record more motion"), 1, "record more motion"),
        (KeyboardInterrupt(), 130, "finished fits are in"),
    ],
)
def test_a_diagnosis_that_ends_early_leaves_nothing_but_its_fits(
    short_example, tmp_path, capsys, monkeypatch, error, code, words
):
    def fail(*given):
        raise error

    monkeypatch.setattr(MODULE, "diagnose", fail)
    arguments = ["--workers", "1", "--keep", str(tmp_path / "fits"), "-o", str(tmp_path / "out")]
    assert cli.run(["diagnose", str(short_example), *arguments]) == code
    assert words in error_line(capsys)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("error", [FitError, ModelError, CaseError])
def test_a_diagnosis_outlives_a_refinement_that_fails(monkeypatch, error):
    """Whatever fails in the last minute, the verdict took half an hour."""

    def refine(*given):
        raise error("the simulation leaves the finite numbers")

    monkeypatch.setattr(REFINE, refine)
    refined, failure = _refined(None, made.EFFECT, no_progress)
    assert refined is None and "leaves the finite numbers" in failure


def test_a_folder_of_another_kind_is_refused_before_any_work(embedded, tmp_path, capsys, given):
    (tmp_path / "result.json").write_text("{}")
    assert cli.run(["diagnose", str(embedded), "-o", str(tmp_path)]) == 2
    assert "holds result.json and no earlier diagnosis" in error_line(capsys)
    assert not given


@pytest.mark.slow
def test_fits_share_the_processors(monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    with processes(2) as executor:
        assert executor is not None
        # A function that every process can import: test modules are not always on its path.
        assert executor.submit(os.getenv, "OMP_NUM_THREADS").result() == "1"
    assert os.getenv("OMP_NUM_THREADS") is None
    with processes(1) as executor:
        assert executor is None
    assert 1 <= default_workers() <= 4


def test_the_time_left_is_told_once_it_can_be():
    assert time_left(3.0, 0.01) is None
    assert time_left(30.0, 0.6) == pytest.approx(20.0)
    assert time_left(30.0, 1.0) == 0.0
