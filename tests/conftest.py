"""Fixtures shared by all tests."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """Folder of the development data, named by PNEUMO_CASADI_DATA."""
    folder = os.environ.get("PNEUMO_CASADI_DATA")
    if not folder:
        pytest.skip("PNEUMO_CASADI_DATA is not set: no development data")
    return Path(folder)
