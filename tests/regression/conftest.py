"""The hand-typed model and records, as fixtures, so that tests need no import from each other."""

import importlib.util
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def made():
    """Module with the hand-typed eq. 7 and the records that obey it."""
    spec = importlib.util.spec_from_file_location("models", Path(__file__).with_name("models.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
