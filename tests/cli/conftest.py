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


@pytest.fixture(autouse=True)
def one_process(monkeypatch):
    """Do all in this process, where drawings are left blank; tests of workers say how many."""
    monkeypatch.setattr("pneumo_casadi.runtime.processes.default_workers", lambda: 1)


@pytest.fixture
def png_only(monkeypatch, leave_blank):
    """Draw each figure once, and no curves to zoom: what is tested is the folder."""
    leave_blank(monkeypatch, "svg")
    monkeypatch.setattr("pneumo_casadi.report.interactive.time_plot.find_spec", lambda name: None)


@pytest.fixture
def not_drawn(monkeypatch, png_only, leave_blank):
    """Let files of figures hold no drawing: what is tested is that they are there."""
    leave_blank(monkeypatch, "png")
