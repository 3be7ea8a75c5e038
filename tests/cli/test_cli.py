"""The command line: exit codes, one-line errors, nothing half-written."""

import json
import logging
import shutil
import signal
from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pneumo_casadi import __version__
from pneumo_casadi.cli import app as cli
from pneumo_casadi.errors import FitError
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.report.pages.identification_figures import figures_of
from pneumo_casadi.report.pages.report import write_report
from pneumo_casadi.runtime.json_files import write_json

#: The form of the flow map is given: choosing it takes a second, and is not what is tested here.
FORM = ("--flow", "polynomials")


@pytest.fixture(scope="session")
def result(quick, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("result") / "result.json"
    write_json(result_dict(quick), path)
    return path


@pytest.fixture
def one_figure(monkeypatch, not_drawn):
    """Write one figure only."""
    monkeypatch.setattr(
        "pneumo_casadi.report.pages.identification_figures.figures_of",
        lambda found: islice(figures_of(found), 1, 2),
    )


@pytest.fixture
def short_case(short_example, tmp_path) -> Path:
    """A copy that may be changed."""
    return shutil.copytree(short_example, tmp_path / "short")


def error_line(capsys) -> str:
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1, lines
    assert lines[0].startswith("error: ")
    return lines[0]


@pytest.mark.parametrize("arguments", [["demo"], ["identify"], ["validate"], ["simulate"]])
def test_every_command_has_help(arguments, capsys):
    assert cli.run([*arguments, "--help"]) == 0
    text = capsys.readouterr().out
    assert "--output" in text
    assert "--json" in text


def test_the_version_is_printed(capsys):
    assert cli.run(["--version"]) == 0
    assert __version__ in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments",
    [["identify"], ["nonsense"], ["identify", "x", "--flow", "cubic"], ["identify", "--what"]],
)
def test_wrong_usage_is_one_line_and_exit_code_2(arguments, capsys):
    assert cli.run(arguments) == 2
    assert "--help" in error_line(capsys)


def test_a_missing_folder_is_one_line_and_exit_code_2(tmp_path, capsys):
    assert cli.run(["identify", str(tmp_path / "gone"), "-o", str(tmp_path / "out")]) == 2
    assert "gone" in error_line(capsys)
    assert not (tmp_path / "out").exists()


def test_a_bad_value_is_named_with_file_row_and_remedy(short_case, tmp_path, capsys):
    frame = pd.read_csv(short_case / "identify.csv.gz", nrows=2500)
    frame.loc[1234, "p_P_Pa"] = np.nan
    frame.to_csv(short_case / "identify.csv.gz", index=False)
    assert cli.run(["identify", str(short_case), "-o", str(tmp_path / "out")]) == 2
    line = error_line(capsys)
    assert "identify.csv.gz" in line
    assert "1235" in line or "1236" in line
    assert "p_P" in line
    assert not (tmp_path / "out").exists()


def test_a_failed_fit_is_exit_code_1_and_leaves_nothing(
    short_example, tmp_path, capsys, monkeypatch
):
    def fail(*arguments, **options):
        raise FitError("output error: no convergence; start nearer to the data")

    monkeypatch.setattr("pneumo_casadi.identification.identify.fit_output_error", fail)
    out = tmp_path / "out"
    arguments = ["identify", str(short_example), *FORM, "--end", "11", "-o", str(out)]
    assert cli.run([*arguments, "--json", str(tmp_path / "r.json")]) == 1
    assert "start nearer" in error_line(capsys)
    assert not list(tmp_path.iterdir())


def test_an_interruption_is_exit_code_130_and_leaves_nothing(
    short_example, tmp_path, capsys, monkeypatch
):
    def interrupt(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("pneumo_casadi.identification.identify.fit_wls", interrupt)
    assert cli.run(["identify", str(short_example), *FORM, "-o", str(tmp_path / "out")]) == 130
    assert "interrupted" in error_line(capsys)
    assert not list(tmp_path.iterdir())


def test_an_interruption_inside_a_compiled_function_is_told_from_a_defect(
    short_example, tmp_path, capsys, monkeypatch
):
    def garble(*arguments, **options):
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise NotImplementedError("wrong type of arguments") from None

    monkeypatch.setattr("pneumo_casadi.identification.identify.fit_wls", garble)
    assert cli.run(["identify", str(short_example), *FORM, "-o", str(tmp_path / "out")]) == 130
    assert "interrupted" in error_line(capsys)
    assert not list(tmp_path.iterdir())


def test_a_defect_is_not_hidden(short_example, tmp_path, monkeypatch):
    def break_down(*arguments, **options):
        raise ZeroDivisionError

    monkeypatch.setattr("pneumo_casadi.identification.identify.fit_wls", break_down)
    with pytest.raises(ZeroDivisionError):
        cli.run(["identify", str(short_example), *FORM, "-o", str(tmp_path / "out")])
    assert not list(tmp_path.iterdir())


def test_a_command_leaves_the_log_as_it_was(tmp_path):
    logger = logging.getLogger("pneumo_casadi")
    before = (logger.level, list(logger.handlers))
    cli.run(["identify", str(tmp_path / "gone")])
    assert (logger.level, list(logger.handlers)) == before


def test_debug_shows_the_traceback(tmp_path, capsys):
    assert cli.run(["identify", str(tmp_path / "gone"), "--debug"]) == 2
    assert "Traceback" in capsys.readouterr().err


def test_a_folder_with_other_files_is_not_replaced(embedded, tmp_path, capsys):
    (tmp_path / "thesis.tex").write_text("years of work")
    assert cli.run(["identify", str(embedded), "-o", str(tmp_path)]) == 2
    assert "thesis.tex" in error_line(capsys)
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


@pytest.mark.slow
def test_validate_compares_with_held_out_records(short_case, result, tmp_path, capsys, not_drawn):
    out, file = tmp_path / "out", tmp_path / "v.json"
    arguments = ["validate", str(short_case), "-p", str(result), "-o", str(out), "--strict"]
    assert cli.run([*arguments, "--json", str(file)]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("Usable") and "held-out" in printed
    assert json.loads(file.read_text())["usable"] == "yes"
    content = json.loads(file.read_text())["validation"]
    assert set(content["windows"]) == {"0.1", "0.5"}  # 2 s is longer than the record
    assert content["x"]["rms"] < 1e-3
    assert (out / "figures" / "validation_validate.png").is_file()


@pytest.mark.parametrize("loop", ["--open-loop", "--closed-loop"])
def test_a_simulation_has_the_columns_of_a_case_folder(short_case, result, tmp_path, loop):
    arguments = ["simulate", str(short_case), "-p", str(result), loop]
    assert cli.run([*arguments, "-o", str(tmp_path / "out")]) == 0
    measured = pd.read_csv(short_case / "validate.csv.gz")
    simulated = pd.read_csv(tmp_path / "out" / "simulation" / "validate.csv")
    assert list(simulated.columns) == list(measured.columns)
    assert np.array_equal(simulated["t_s"], measured["t_s"])
    assert np.abs(simulated["x_m"] - measured["x_m"]).max() < 2e-3
    if loop == "--open-loop":
        assert np.allclose(simulated["u_P_V"], measured["u_P_V"], atol=1e-9)


def test_parameters_that_are_no_result_are_exit_code_2(short_example, tmp_path, capsys):
    (tmp_path / "p.json").write_text("{}")
    assert cli.run(["simulate", str(short_example), "-p", str(tmp_path / "p.json")]) == 2
    assert "p.json" in error_line(capsys)


@pytest.mark.slow
def test_identify_leaves_a_report_and_prints_table_and_warnings(
    quick, tmp_path, capsys, monkeypatch, one_figure
):
    monkeypatch.setattr(
        "pneumo_casadi.identification.identify.identify", lambda case, options, progress: quick
    )
    out = tmp_path / "out"
    assert cli.run(["identify", "anything", "-o", str(out), "--paper"]) == 0
    assert {path.name for path in out.iterdir()} == {
        "result.json",
        "curves.json",
        "report.html",
        "table.txt",
        "figures",
        ".pneumo_casadi.json",
    }
    text = capsys.readouterr().out
    assert "Table 1" in text
    assert "Before you use these numbers" in text


@pytest.mark.slow
def test_an_earlier_report_is_replaced_and_what_was_added_stays(quick, tmp_path, one_figure):
    folder = write_report(quick, tmp_path / "out")
    report = (folder / "report.html").stat().st_ino
    (folder / "figures" / "mine.png").write_bytes(b"mine")
    write_report(quick, folder)
    assert (folder / "report.html").stat().st_ino != report
    assert (folder / "figures" / "mine.png").read_bytes() == b"mine"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.slow
def test_a_report_that_breaks_midway_leaves_the_earlier_one(
    quick, tmp_path, monkeypatch, without_pictures
):
    folder = write_report(quick, tmp_path / "out")
    before = (folder / "result.json").read_bytes()

    def fail(*arguments):
        raise OSError("disk full")

    monkeypatch.setattr("pneumo_casadi.report.pages.write.html_report", fail)
    with pytest.raises(OSError, match="disk full"):
        write_report(quick, folder)
    assert (folder / "result.json").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
