"""The README says what the committed results say, and its commands are those that are tested."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BENCHMARKS = ROOT / "benchmarks"


@pytest.fixture(scope="module")
def readme(script):
    return script(BENCHMARKS / "readme.py")


def test_the_tables_are_those_of_the_committed_results(readme):
    text = (ROOT / "README.md").read_text("utf-8")
    assert text.count("<!-- table: ") == len(readme.TABLES)
    assert readme.written(text) == text, "run: python benchmarks/readme.py"


def test_a_stale_table_would_be_noticed(readme):
    text = (ROOT / "README.md").read_text("utf-8")
    stale = text.replace("| X_s1 |", "| X_s1 (old) |", 1)
    assert stale != text and readme.written(stale) == text


def test_every_picture_and_link_of_the_readme_exists():
    text = (ROOT / "README.md").read_text("utf-8")
    targets = re.findall(r"\]\((?!http)([^)#]+)\)", text)
    assert targets
    for target in targets:
        assert (ROOT / target).exists(), target
