"""The page on the diagnosis quotes the criteria that the code uses."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

import pneumo_casadi
from pneumo_casadi.diagnosis.prepare.criteria import Criteria

PAGE = Path(__file__).resolve().parents[2] / "docs" / "explanation" / "diagnosis.md"
TEXT = PAGE.read_text("utf-8")
QUOTED = re.findall(r"`([A-Z_]+)` = ([\d.]+)", TEXT)
CRITERIA = re.findall(r"`([a-z_]+)` = ([\d.]+)", TEXT)


@cache
def constants() -> set[tuple[str, float]]:
    """Return names and values of the numbers that modules of diagnosis and signals define."""
    defined = set()
    package = Path(pneumo_casadi.__file__).parent
    for path in (*package.glob("diagnosis/**/*.py"), *package.glob("signals/*.py")):
        for node in ast.parse(path.read_text("utf-8")).body:
            if not isinstance(node, ast.Assign):
                continue
            targets, value = node.targets[0], node.value
            if isinstance(targets, ast.Tuple) and isinstance(value, ast.Tuple):
                pairs = list(zip(targets.elts, value.elts, strict=True))
            else:
                pairs = [(targets, value)]
            defined |= {
                (target.id, float(item.value))
                for target, item in pairs
                if isinstance(target, ast.Name)
                and isinstance(item, ast.Constant)
                and isinstance(item.value, (int, float))
            }
    return defined


def test_the_page_quotes_criteria():
    assert len(QUOTED) + len(CRITERIA) > 12


@pytest.mark.parametrize(("name", "value"), CRITERIA)
def test_a_criterion_of_the_verdict_is_as_stated(name, value):
    assert getattr(Criteria(), name) == float(value)


@pytest.mark.parametrize(("name", "value"), QUOTED)
def test_a_criterion_has_the_value_that_the_page_states(name, value):
    assert (name, float(value)) in constants()
