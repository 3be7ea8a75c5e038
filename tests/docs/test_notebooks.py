"""Every notebook runs to its last cell, which asserts its claim, and is stored without outputs."""

import ast
import inspect
import re
from io import BytesIO
from pathlib import Path

import matplotlib.pyplot as plt
import nbformat
import pandas as pd
import pytest
from matplotlib.figure import Figure
from nbclient import NotebookClient

import pneumo_casadi as pc
from pneumo_casadi.runtime.presentation import Presentable

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


def run_cell(source, names):
    """Run a cell in a namespace and return the value of its last expression, if it has one."""
    tree = ast.parse(source.removeprefix("%matplotlib inline"))
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    if last is None:
        return None
    return eval(compile(ast.Expression(last.value), "cell", "eval"), names)


def is_drawn(figure):
    image = BytesIO()
    figure.savefig(image, format="png", dpi=30)
    return image.getvalue().startswith(b"\x89PNG")


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_notebook_runs_to_its_end(path, demo, monkeypatch, without_figures):
    """In this process: a kernel for each would cost as much as some of them.

    Figures of the notebook itself are drawn, those of reports that it writes are not.
    """
    identify, names, shown = pc.identify, {"__name__": "__main__"}, []

    def identify_once(case, options=None):
        same = case.folder == demo.case.folder and options == demo.options
        return demo if same else identify(case, options)

    monkeypatch.setattr(pc, "identify", identify_once)
    plt.switch_backend("agg")
    for cell in read(path).cells:
        if cell.cell_type == "code":
            shown.append(run_cell(cell.source, names))
            shown += [plt.figure(number) for number in plt.get_fignums()]
            plt.close("all")
    figures = [value for value in shown if isinstance(value, Figure)]
    assert figures and all(is_drawn(figure) for figure in figures)
    tables = [value for value in shown if isinstance(value, Presentable | pd.DataFrame)]
    assert tables and all("<table" in table._repr_html_() for table in tables)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_kernel_shows_tables_and_figures():
    """The cells before the long ones of a notebook; `docs/build.py` runs all notebooks whole."""
    book = read(NOTEBOOKS[5])
    book.cells = book.cells[:5]
    NotebookClient(book, timeout=300, kernel_name="python3").execute()
    shown = [o for c in book.cells if c.cell_type == "code" for o in c.outputs if "data" in o]
    assert any("text/html" in output["data"] for output in shown)
    assert any("image/png" in output["data"] for output in shown)
