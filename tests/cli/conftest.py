"""What several tests of commands share."""

import pytest


def svg(figure):
    """Return no drawing in the place of `style.svg`, whose name tells the file."""
    return b'<svg width="9pt" height="9pt"></svg>'


@pytest.fixture
def png_only(monkeypatch):
    """Draw each figure once, and no curves to zoom: what is tested is the folder."""
    monkeypatch.setattr("pneumo_casadi.report.figures.style.svg", svg)
    monkeypatch.setattr("pneumo_casadi.report.interactive.time_plot.find_spec", lambda name: None)
