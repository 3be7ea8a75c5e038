"""The gain is real on the virtual bench, which shares no equation with the model."""

import importlib.util
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def bench():
    """The benchmark that records designs on the virtual bench."""
    spec = importlib.util.spec_from_file_location("design_benchmark", BENCHMARKS / "design.py")
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(BENCHMARKS))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(BENCHMARKS))
    return module


def test_standard_errors_shrink_as_predicted(bench):
    found = bench.precision(0, 6.0, 100)
    assert found["gain"] > 1.2
    for name, one in found["parameters"].items():
        assert one["real"] == pytest.approx(one["predicted"], rel=0.3), name
    shares = found["shares_of_limits"]
    assert shares["position"] <= 1 and shares["command"] <= 1
    assert shares["p_min"] >= 1 and shares["p_max"] <= 1
