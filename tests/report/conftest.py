"""What several tests of reports draw and write."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def made_design(script):
    """Return the function that makes a design by hand; see `designs.py`."""
    return script(Path(__file__).with_name("designs.py")).made_design


def svg(figure):
    """Return no drawing in the place of `style.svg`, whose name tells the file."""
    return b'<svg width="9pt" height="9pt"></svg>'


@pytest.fixture(scope="session")
def no_svg():
    """Return what stands for `style.svg` where a drawing of each figure is enough."""
    return svg
