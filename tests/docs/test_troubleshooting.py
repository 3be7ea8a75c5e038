"""Messages that the troubleshooting page quotes are those of the source."""

import ast
import re
from pathlib import Path

import pytest

import pneumo_casadi

PAGE = Path(__file__).resolve().parent.parent.parent / "docs" / "how_to" / "troubleshooting.md"
QUOTED = re.compile(r"``(.+?)``")


def texts():
    """Return every text of the package but its docstrings, with … for what is filled in."""
    texts = set()
    for path in Path(pneumo_casadi.__file__).parent.rglob("*.py"):
        described = set()  # a walk comes to what holds a docstring before the docstring
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Expr):
                described.add(node.value)
            elif isinstance(node, ast.JoinedStr):
                parts = [
                    part.value if isinstance(part, ast.Constant) else "…" for part in node.values
                ]
                texts.add("".join(parts))
            elif isinstance(node, ast.Constant) and node not in described:
                texts.add(str(node.value))
    return texts


@pytest.fixture(scope="module")
def said():
    return texts()


def quoted(page):
    return [text.strip() for text in QUOTED.findall(page)]


def is_said(message, said):
    """Tell whether one text of the package has all parts of a message in their order."""
    pattern = re.compile(".*".join(map(re.escape, message.split("…"))), re.DOTALL)
    return any(pattern.search(text) for text in said)


@pytest.mark.slow
def test_every_message_quoted_is_in_the_source(said):
    messages = quoted(PAGE.read_text("utf-8"))
    assert len(messages) > 80
    assert not [message for message in messages if not is_said(message, said)]


def test_a_message_that_nobody_says_is_noticed(said):
    assert is_said("a dead sensor or no excitation; record again", said)
    assert not is_said("a sensor without electricity", said)
    assert not is_said("Base of all errors that the package raises on purpose", said)


def test_every_row_has_a_message_a_cause_and_a_remedy():
    rows = [line for line in PAGE.read_text("utf-8").splitlines() if line.startswith("| ")]
    cells = [re.split(r"(?<!\\)\|", row)[1:-1] for row in rows]
    assert len(rows) > 80
    assert not [row for row, row_cells in zip(rows, cells, strict=True) if len(row_cells) != 3]
    assert all(cell.strip() for row_cells in cells for cell in row_cells)
