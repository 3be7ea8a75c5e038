"""Fixtures shared by all tests."""

import importlib.util
import os
from dataclasses import replace
from importlib import resources
from pathlib import Path

import pytest

# Tests share the processors: threads of linear algebra besides only wait for each other, and a
# product of small matrices takes a hundred times as long. They are counted when NumPy is loaded.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from pneumo_casadi.pipeline import (  # noqa: E402
    Identification,
    IdentifyOptions,
    identify,
    open_case,
)


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """Folder of the development data, named by PNEUMO_CASADI_DATA."""
    folder = os.environ.get("PNEUMO_CASADI_DATA")
    if not folder:
        pytest.skip("PNEUMO_CASADI_DATA is not set: no development data")
    return Path(folder)


@pytest.fixture(scope="session")
def made():
    """Module with small axes of known truth: tests need no import from each other."""
    spec = importlib.util.spec_from_file_location(
        "made_axes", Path(__file__).parent / "model" / "made.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def embedded() -> Path:
    """Folder of the embedded record whose true parameters are known."""
    return Path(str(resources.files("pneumo_casadi") / "data" / "table1"))


@pytest.fixture(scope="session")
def quick(embedded: Path) -> Identification:
    """An identification of a few seconds of record: quick to make, not to be trusted."""
    case = open_case(embedded)
    case = replace(case, validate=(case.validate[0].window(8.0, 10.0),))
    return identify(case, IdentifyOptions(start=10.0, end=13.0, windows=(0.5,)))
