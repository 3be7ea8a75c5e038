"""What several tests of reports draw and write."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def made_design(script):
    """Return the function that makes a design by hand; see `designs.py`."""
    return script(Path(__file__).with_name("designs.py")).made_design


@pytest.fixture(scope="session")
def drawn(script):
    """The figures of a report by name, as `write_diagnosis` asks for them."""
    from pneumo_casadi.report.pages.diagnosis import _figures_of

    made = script(Path(__file__).with_name("diagnoses.py"))
    return {drawing.name: drawing for drawing in _figures_of(made.with_curves())}
