"""Options of ``identify``, ``validate`` and ``compare`` that choose a model or refuse a result."""

import importlib
import json
from dataclasses import replace

import pytest

from pneumo_casadi.cli import app as cli
from pneumo_casadi.cli.options import time_and_values, values_of
from pneumo_casadi.data import Grade
from pneumo_casadi.errors import CaseError, FitError
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.identification.warnings import ResultWarning
from pneumo_casadi.runtime.json_files import write_json

#: The module; as an attribute of its package the name is the function's.
MODULE = importlib.import_module("pneumo_casadi.identification.identify")


@pytest.fixture
def options_given(monkeypatch):
    """The options that an identification gets, which then ends: nothing is fitted or written."""
    options_given = []

    def identify(case, options, progress):
        options_given.append(options)
        raise FitError("enough")

    monkeypatch.setattr(MODULE, "identify", identify)
    return options_given


@pytest.fixture
def given(quick, monkeypatch, without_pictures):
    """An identification in the place of the fit, and no figures."""

    def identify(case, options, progress):
        return replace(quick, warnings=given_warnings)

    given_warnings: tuple[ResultWarning, ...] = ()
    monkeypatch.setattr(MODULE, "identify", identify)

    def with_warnings(*grades):
        nonlocal given_warnings
        given_warnings = tuple(ResultWarning(g, "physics", "it is heavy.") for g in grades)

    return with_warnings


def test_effects_held_parameters_and_starts_reach_the_identification(tmp_path, options_given):
    arguments = ["--with", "stribeck", "--with", "hose", "--fix", "M=16.4", "--together"]
    arguments += ["--start", "10", "--start", "k_P=1.2", "--end", "12"]
    assert cli.run(["identify", "case", "-o", str(tmp_path / "out"), *arguments]) == 1
    (options,) = options_given
    assert options.effects == ("stribeck", "hose")
    assert options.fixed == {"M": 16.4} and options.start_values == {"k_P": 1.2}
    assert (options.start, options.end, options.each_record) == (10.0, 12.0, False)


@pytest.mark.parametrize(
    ("arguments", "widths"),
    [
        ([], (1e-4,)),
        (["--friction-width", "5e-6"], (1e-4, 5e-6)),
        (["--friction-width", "1e-3"], (1e-3,)),
    ],
)
def test_the_width_of_the_friction_is_the_last_one(tmp_path, options_given, arguments, widths):
    assert cli.run(["identify", "case", "-o", str(tmp_path / "out"), *arguments]) == 1
    assert options_given[0].output_error.widths == widths


@pytest.mark.parametrize("width", ["0", "-1", "1", "nan", "wide"])
def test_a_width_that_cannot_be_is_refused(tmp_path, options_given, width, capsys):
    arguments = ["identify", "case", "-o", str(tmp_path / "out"), "--friction-width", width]
    assert cli.run(arguments) == 2
    assert "--friction-width" in capsys.readouterr().err and not options_given


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (["M"], "--fix M: expected NAME=VALUE"),
        (["M=heavy"], "--fix M=heavy"),
        (["M=inf"], "--fix M=inf"),
        (["M=1", "M=2"], "each name once"),
        (["=1"], "NAME=VALUE"),
    ],
)
def test_what_is_no_value_is_told(texts, words):
    with pytest.raises(CaseError, match=words):
        values_of("--fix", texts)


def test_two_times_to_start_from_are_refused():
    with pytest.raises(CaseError, match="--start 1 --start 2: expected one time"):
        time_and_values(["1", "2"])
    assert time_and_values(["M=16"]) == (None, {"M": 16.0})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("grades", "usable", "code"),
    [
        ([], "yes", 0),
        ([Grade.NOTE], "yes", 0),
        ([Grade.CAUTION, Grade.NOTE], "with care", 0),
        ([Grade.SEVERE, Grade.CAUTION], "no", 3),
    ],
)
def test_strict_refuses_what_is_not_to_be_used(tmp_path, capsys, given, grades, usable, code):
    given(*grades)
    out, file = tmp_path / "out", tmp_path / "r.json"
    arguments = ["identify", "case", "-o", str(out), "--json", str(file)]
    assert cli.run([*arguments, "--strict"]) == code
    lead = {"yes": "Usable: ", "with care": "Usable with care: ", "no": "Do not use: it is heavy."}
    assert capsys.readouterr().out.startswith(lead[usable])
    content = json.loads(file.read_text("utf-8"))
    assert content["usable"] == usable
    assert [item["grade"] for item in content["warnings"]] == [grade.value for grade in grades]
    # A refused result is written all the same.
    assert lead[usable] in (out / "table.txt").read_text("utf-8")
    words, _, reason = lead[usable].partition(": ")
    page = (out / "report.html").read_text("utf-8")
    assert f">{words}</h2>\n<p>{reason[:1].upper()}{reason[1:]}" in page
    if code:
        assert cli.run(arguments) == 0


@pytest.mark.slow
def test_validate_takes_a_folder_and_refuses_what_is_far_off(
    quick, short_example, tmp_path, capsys
):
    """That it accepts what is not is claimed where its report is."""
    result = tmp_path / "result"
    arguments = ["validate", str(short_example), "-p", str(result), "--strict"]
    content = result_dict(quick)
    for name in ("X_s1", "X_s4"):  # twice the volume of both chambers
        content["output_error"]["parameters"][name]["value"] *= 2
    write_json(content, result / "result.json")
    assert cli.run(arguments) == 3
    assert capsys.readouterr().out.startswith("Do not use: On held-out records the simulation")


def test_compare_prints_what_moved_and_writes_json(
    quick, short_example, tmp_path, capsys, without_pictures
):
    content = result_dict(quick) | {"folder": str(short_example)}
    write_json(content, tmp_path / "before" / "result.json")
    content["output_error"]["parameters"]["M"]["value"] *= 1.1
    content["folder"] = str(tmp_path / "gone")
    write_json(content, tmp_path / "after" / "result.json")
    pair = [str(tmp_path / "before"), str(tmp_path / "after")]
    out, file = tmp_path / "out", tmp_path / "c.json"
    assert cli.run(["compare", *pair, "-o", str(out), "--json", str(file)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "before and after: 1 parameter differs by more than 3 σ, most M (+10 %" in text
    assert "after: its records are not simulated" in text
    compared = json.loads(file.read_text("utf-8"))
    assert compared == json.loads((out / "comparison.json").read_text("utf-8"))
    assert [item["name"] for item in compared["differences"] if item["moved"]] == ["M"]


def test_compare_needs_two(tmp_path, capsys):
    assert cli.run(["compare", str(tmp_path)]) == 2
    assert "two or more" in capsys.readouterr().err
