"""Every notebook runs to its last cell, which asserts its claim, and is stored without outputs."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "notebooks").glob("*.ipynb"))


def read(path):
    return nbformat.read(path, as_version=4)


def test_all_seven_notebooks_are_there():
    assert [path.stem[:3] for path in NOTEBOOKS] == [f"{number:02d}_" for number in range(1, 8)]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_outputs_are_stripped_and_the_last_cell_asserts(path):
    cells = read(path).cells
    assert all(not cell.outputs for cell in cells if cell.cell_type == "code")
    assert "assert " in cells[-1].source


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_notebook_runs_to_its_end(path):
    book = read(path)
    NotebookClient(book, timeout=300, kernel_name="python3").execute()
    drawn = [o for c in book.cells if c.cell_type == "code" for o in c.outputs if "data" in o]
    assert any("image/png" in output["data"] for output in drawn)
