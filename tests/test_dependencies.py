"""Lower bounds of the dependencies leave out releases with known holes."""

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "explanation" / "dependencies.md"
ROW = re.compile(r"^\| ([a-z0-9]+) \| ([\d.]+) \| CVE-", re.MULTILINE)


def lower_bounds():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = project["optional-dependencies"].values()
    named = [text for group in (project["dependencies"], *extras) for text in group]
    requirements = [Requirement(text) for text in named]
    return {
        item.name: Version(bound.version)
        for item in requirements
        for bound in item.specifier
        if bound.operator == ">="
    }


@pytest.mark.parametrize(("package", "least"), ROW.findall(PAGE.read_text("utf-8")))
def test_releases_with_known_holes_are_left_out(package, least):
    assert lower_bounds()[package] >= Version(least)


def test_the_page_names_packages():
    assert len(ROW.findall(PAGE.read_text("utf-8"))) >= 6
