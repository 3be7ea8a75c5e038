"""``pneumo-casadi simulate --bench``: case folders from the command line."""

import json

import pytest

from pneumo_casadi.cli import app as cli
from pneumo_casadi.data import read_case

SHORT = ["--duration", "2", "--fs", "500"]


@pytest.mark.slow
def test_simulate_writes_a_case_folder_and_the_labels_beside_it(tmp_path, capsys):
    folder, labels = tmp_path / "case", tmp_path / "labels.json"
    hidden = ["--effect", "stribeck:large", "--effect", "backlash", "--severity", "small"]
    arguments = ["simulate", "--bench", "--seed", "4", *hidden, *SHORT, "-o", str(folder)]
    assert cli.run([*arguments, "--json", str(labels)]) == 0
    assert read_case(folder).identify[0].N == 1000
    found = json.loads(labels.read_text())
    assert [(one["name"], one["severity"]) for one in found["effects"]] == [
        ("stribeck", "large"),
        ("backlash", "small"),
    ]
    assert found["truth"]["M"] > 0
    assert str(folder) in capsys.readouterr().out.replace("\n", "")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--bench", "--effect", "rust"], "there are stribeck"),
        (["--bench", "--effect", "hose", "--effect", "hose:large"], "twice"),
        (["--bench", "--severity", "huge", "--effect", "hose"], "small, medium, large"),
        (["--bench", "--json", "OUT/labels.json"], "must not lie"),
        (["--bench", "somewhere"], "leave out CASE"),
    ],
)
def test_usage_errors_are_one_line_and_write_nothing(tmp_path, capsys, arguments, words):
    folder = tmp_path / "case"
    given = [argument.replace("OUT", str(folder)) for argument in arguments]
    assert cli.run(["simulate", *given, *SHORT, "-o", str(folder)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert words in lines[0]
    assert not folder.exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--fs", "500"], "or --bench"),
        (["CASE", "-p", "r", "--seed", "3"], "--seed goes with --bench"),
        (["CASE", "-p", "r", "--effect", "hose", "--fs", "500"], "--fs goes with --bench"),
        (["--bench", "--open-loop"], "--open-loop goes with CASE"),
        (["--bench", "--closed-loop"], "--closed-loop goes with CASE"),
        (["--bench", "--records", "identify"], "--records goes with CASE"),
    ],
)
def test_options_of_the_other_mode_are_refused(tmp_path, capsys, arguments, words):
    """Ignored, they leave a result of another seed or loop than was asked for."""
    folder = tmp_path / "case"
    assert cli.run(["simulate", *arguments, "-o", str(folder)]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert words in line
    assert not folder.exists()
