"""What several tests of reports draw and write."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def made_design(script):
    """Return the function that makes a design by hand; see `designs.py`."""
    return script(Path(__file__).with_name("designs.py")).made_design
