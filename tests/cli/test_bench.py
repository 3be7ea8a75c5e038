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
        ([], "or --bench"),
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
