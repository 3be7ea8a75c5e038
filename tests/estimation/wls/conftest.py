"""The hand-typed model and records, as fixtures, so that tests need no import from each other."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def made(script):
    """Module with the hand-typed eq. 7 and the records that obey it."""
    return script(Path(__file__).with_name("models.py"))
