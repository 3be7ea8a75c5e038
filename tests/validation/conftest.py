"""Records of axes of known truth, made once for all tests here."""

import pytest


@pytest.fixture(scope="session")
def simulated(made):
    """A servo axis of known truth under control for two seconds: axis, commands, states."""
    axis = made.true_axis()
    return axis, *made.controlled(axis, 2000)
