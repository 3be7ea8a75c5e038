"""The page from a log file to a checked case: every block runs, every text is what is printed."""

import importlib.util
import json
import re
from pathlib import Path

import pytest

from pneumo_casadi.cli import app as cli
from pneumo_casadi.data import read_case

_spec = importlib.util.spec_from_file_location("guide", Path(__file__).with_name("guide.py"))
guide = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(guide)

PAGE = Path(__file__).resolve().parent.parent.parent / "docs" / "how_to" / "first_case.md"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("first_case")
    guide.run(PAGE, folder)
    return folder


def shown(beginning):
    """Return the block of text of the page that begins so."""
    return next(b.text for b in guide.blocks(PAGE) if b.text.startswith(beginning))


def test_the_corrected_case_has_no_finding(folder):
    assert read_case(folder / "my_axis").findings == ()


def test_the_first_check_named_gauge_pressures_as_shown(folder):
    (finding,) = json.loads((folder / "check.json").read_text("utf-8"))["findings"]
    text = " ".join(shown("Check of my_axis: do not use").split())
    assert text == f"Check of my_axis: do not use: {finding['text']}"


def test_init_prints_what_is_shown(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    command = next(
        line for b in guide.blocks(PAGE) for line in b.text.splitlines() if " init " in line
    )
    words = [str(tmp_path / "my_axis") if w == "my_axis" else w for w in command.split()[1:]]
    assert cli.run(words) == 0
    printed = capsys.readouterr().out.replace(str(tmp_path / "my_axis"), "my_axis")
    assert printed == shown("t         from column ms")


def test_every_option_of_init_is_named():
    text = PAGE.read_text("utf-8")
    named = set(re.findall(r"--[a-z][a-z-]+", text))
    options = {"--piston", "--rod", "--stroke", "--supply", "--ambient", "--temperature", "--gauge",
               "--double-rod", "--gain", "--u-max", "--flow-map", "--column", "--validate",
               "--output"}  # fmt: skip
    assert options <= named
