"""Every notebook ends with its claim and is stored without outputs; `docs/build.py` runs them."""

import ast
import inspect
import re
from pathlib import Path

import nbformat
import pytest

import pneumo_casadi as pc

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "notebooks").glob("*.ipynb"))


def read(path):
    return nbformat.read(path, as_version=4)


def test_all_ten_notebooks_are_there():
    assert [path.stem[:3] for path in NOTEBOOKS] == [f"{number:02d}_" for number in range(10)]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_outputs_are_stripped_and_the_last_cell_asserts(path):
    cells = read(path).cells
    assert all(not cell.outputs for cell in cells if cell.cell_type == "code")
    assert "assert " in cells[-1].source


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_uses_the_public_namespace_alone(path):
    cells = [cell.source for cell in read(path).cells if cell.cell_type == "code"]
    tree = ast.parse("\n".join(cells).replace("%matplotlib inline", ""))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert len(imports) <= 3
    own = [ast.unparse(node) for node in imports if "pneumo_casadi" in ast.unparse(node)]
    assert own == ["import pneumo_casadi as pc"]
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            assert node.end_lineno - node.lineno < 5, f"{node.name} is too long"
        if isinstance(node, ast.Attribute) and re.fullmatch(r"pc\.\w+", ast.unparse(node.value)):
            room = getattr(pc, ast.unparse(node.value).removeprefix("pc."))
            assert not inspect.ismodule(getattr(room, node.attr)), ast.unparse(node)
        elif isinstance(node, ast.Attribute) and ast.unparse(node.value) == "pc":
            assert node.attr in dir(pc), ast.unparse(node)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_figures_are_drawn_inline(path):
    assert read(path).cells[1].source.startswith("%matplotlib inline\n")
