"""What several tests of commands share."""

import shutil
from pathlib import Path

import pandas as pd
import pytest


@pytest.fixture(scope="session")
def short_example(embedded, tmp_path_factory) -> Path:
    """The embedded case with three seconds to identify from, and one held out."""
    folder = tmp_path_factory.mktemp("example") / "short"
    shutil.copytree(embedded, folder)
    for name, first, rows in (("identify.csv.gz", 25_000, 15_000), ("validate.csv.gz", 0, 5000)):
        frame = pd.read_csv(folder / name)
        frame.iloc[first : first + rows].to_csv(folder / name, index=False)
    return folder


@pytest.fixture
def png_only(monkeypatch, no_svg):
    """Draw each figure once, and no curves to zoom: what is tested is the folder."""
    monkeypatch.setattr("pneumo_casadi.report.figures.style.svg", no_svg)
    monkeypatch.setattr("pneumo_casadi.report.interactive.time_plot.find_spec", lambda name: None)


@pytest.fixture
def not_drawn(monkeypatch, png_only):
    """Let files of figures hold no drawing: what is tested is that they are there."""
    monkeypatch.setattr("pneumo_casadi.report.figures.style.png", png)
    monkeypatch.setattr("pneumo_casadi.report.pages.identification_figures.png", png)


def png(figure):
    """Return the beginning of a PNG file in the place of `style.png`, whose name tells the file."""
    return b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\4\0\0\0\2\0"
