"""Names and phrases that a reader has to guess do not occur in the package."""

import ast
import re
from pathlib import Path

import pytest

import pneumo_casadi

PACKAGE = Path(pneumo_casadi.__file__).parent
SOURCES = {
    path.relative_to(PACKAGE).as_posix(): path.read_text("utf-8")
    for path in sorted(PACKAGE.rglob("*.py"))
}
#: Identifiers that do not say what they hold or do. A local variable takes the name of its content.
RIDDLES = frozenset(
    (
        *("found", "one", "along", "believing", "believed", "mending", "mended", "gates"),
        *("polish", "polished", "sensed", "said", "place", "walk", "pull", "steps"),
        *("long_run", "told", "asked"),
    )
)
#: As above for modules, functions and classes; a variable may hold the inverse of a matrix.
RIDDLES_OF_CODE = RIDDLES | {"inverse"}
#: Phrases that must be read twice.
PHRASES = (
    "second thoughts",
    "mends what no axis can have",
    "small beside the gap",
    "are a rest",
    "is to be believed",
    "simulation and reality part",
    "may lack what the axis does",
    "lacks what the axis does",
)


def riddles_in(module: str, text: str) -> set[str]:
    """Return the riddles among the names that a module defines: variables, arguments, code."""
    variables, code = set(), {Path(module).stem}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            variables.add(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            variables.add(node.attr)
        elif isinstance(node, ast.arg):
            variables.add(node.arg)
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            code.add(node.name)
        elif isinstance(node, ast.alias) and node.asname:
            code.add(node.asname)
    return variables & RIDDLES | code & RIDDLES_OF_CODE


def phrases_in(text: str) -> list[str]:
    """Return the phrases that a text contains, across line breaks and quotation marks."""
    plain = re.sub(r'["\s#]+', " ", text).lower()
    return [phrase for phrase in PHRASES if phrase in plain]


def test_identifiers_say_what_they_name():
    riddles = {
        module: names
        for module, text in SOURCES.items()
        if (names := sorted(riddles_in(module, text)))
    }
    assert len(SOURCES) > 250
    assert not riddles


def test_sentences_are_understood_at_first_reading():
    decoded = {module: phrases for module, text in SOURCES.items() if (phrases := phrases_in(text))}
    assert not decoded


@pytest.mark.parametrize(
    "text",
    [
        "found = 1",
        "def fit(one): ...",
        "def polish(): ...",
        "class mending: ...",
        "def inverse(): ...",
        "self.steps = 3",
        "[one for one in ()]",
        "f = lambda told: 0",
        "import numpy as place",
        "for walk in (): ...",
        "with open('') as said: ...",
    ],
)
def test_a_riddle_is_noticed_wherever_it_is_defined(text):
    assert riddles_in("module.py", text)


def test_a_module_of_such_a_name_is_noticed():
    assert riddles_in("estimation/inverse.py", "")


def test_a_phrase_is_noticed_across_lines():
    assert phrases_in('"""Select with second\n    thoughts."""')
    assert phrases_in('"Simulation and reality "\n    "part in the force balance"')


def test_terms_of_the_field_and_other_libraries_are_allowed():
    text = "solver.solve(polish=False)\ninverse = np.linalg.inv(A)\nsteps_per_sample = 3"
    assert not riddles_in("module.py", text)
