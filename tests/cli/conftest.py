"""What several tests of commands share."""

import pytest


@pytest.fixture
def png_only(monkeypatch, no_svg):
    """Draw each figure once, and no curves to zoom: what is tested is the folder."""
    monkeypatch.setattr("pneumo_casadi.report.figures.style.svg", no_svg)
    monkeypatch.setattr("pneumo_casadi.report.interactive.time_plot.find_spec", lambda name: None)
