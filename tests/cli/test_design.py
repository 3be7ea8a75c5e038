"""``pneumo-casadi design``: a folder with a reference and what it will gain."""

import json

import numpy as np
import pandas as pd
import pytest

from pneumo_casadi.cli import app as cli
from pneumo_casadi.data import read_case
from pneumo_casadi.report.figures import style  # noqa: F401  where it is known, no PDF is drawn
from pneumo_casadi.virtual_bench import make_case


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """A second of an axis of the virtual bench."""
    folder = tmp_path_factory.mktemp("design") / "case"
    make_case(folder, 1, fs=500.0, duration=1.0)
    return folder


@pytest.mark.slow
def test_a_design_is_written_whole_and_keeps_its_limits(case, tmp_path, capsys, png_only):
    folder, copy = tmp_path / "next", tmp_path / "copy.json"
    limits = ["--common", "0.05", "--velocity", "0.6", "--duration", "1"]
    arguments = ["design", str(case), "--flow", "iso6358", *limits, "--tries", "20"]
    assert cli.run([*arguments, "-o", str(folder), "--json", str(copy)]) == 0
    frame = pd.read_csv(folder / "reference.csv")
    assert list(frame) == ["t_s", "x_ref_m", "u_common_V"]
    assert len(frame) == 500 and frame["t_s"].diff().iloc[1:].round(9).eq(2e-3).all()
    assert np.abs(frame["u_common_V"]).max() <= 0.05
    found = json.loads((folder / "design.json").read_text("utf-8"))
    assert found["extremes"]["velocity"] <= found["limits"]["velocity_m_per_s"] == 0.6
    assert found["extremes"]["position"] <= found["limits"]["position_m"]
    parameters = found["precision"]["parameters"]
    assert set(parameters) >= {"X_s1", "M", "f_v"}
    assert all(one["std_both"] < one["std_now"] for one in parameters.values())
    assert json.loads(copy.read_text("utf-8"))["gain"] == found["gain"]
    assert (folder / "design.png").read_bytes().startswith(b"\x89PNG")
    page = (folder / "report.html").read_text("utf-8")
    assert "Reference designed" in page and f"{found['gain']:.3g} times" in page
    assert "record the motion of reference.csv" in page and "Provenance" in page
    text = (folder / "design.txt").read_text("utf-8")
    assert "designed/recorded" in text and text.strip().splitlines()[0] in capsys.readouterr().out
    # The record's reference and the designed one are for the same clock.
    assert read_case(case).bench.sampling_frequency == pytest.approx(1 / found["sampling_period_s"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--separate", "rust", "none"], "no effect 'rust'"),
        (["--separate", "stribeck", "stribeck"], "cannot be told from itself"),
    ],
)
def test_usage_errors_are_one_line_and_write_nothing(case, tmp_path, capsys, arguments, words):
    folder = tmp_path / "next"
    assert cli.run(["design", str(case), *arguments, "-o", str(folder)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and words in lines[0]
    assert not folder.exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-p", "result", "--flow", "spline"], "--flow: the form is that of --parameters"),
        (["--separate", "stribeck", "none", "--criterion", "A"], "--criterion: of standard errors"),
    ],
)
def test_options_that_exclude_each_other_are_refused_before_a_file_is_read(
    tmp_path, capsys, arguments, words
):
    assert cli.run(["design", str(tmp_path / "gone"), *arguments]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert words in line


def test_a_folder_with_anything_else_in_it_is_left_alone(case, tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    assert cli.run(["design", str(case), "-o", str(tmp_path)]) == 2
    assert (tmp_path / "thesis.tex").read_text() == "years of work"
