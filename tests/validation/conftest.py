"""Axes of known truth, as a fixture, so that tests need no import from each other."""

import importlib.util
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def made():
    """Module with small axes of known truth and records made from them."""
    spec = importlib.util.spec_from_file_location(
        "made_axes", Path(__file__).parents[1] / "model" / "made.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def simulated(made):
    """A servo axis of known truth under control for three seconds: axis, commands, states."""
    axis = made.true_axis()
    return axis, *made.controlled(axis, 3000)
