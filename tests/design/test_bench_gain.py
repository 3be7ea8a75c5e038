"""The gain is real on the virtual bench, which shares no equation with the model."""

from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def bench(script):
    """The benchmark that records designs on the virtual bench."""
    return script(BENCHMARKS / "design.py")


def test_standard_errors_shrink_as_predicted(bench):
    found = bench.precision(0, 6.0, 100)
    assert found["gain"] > 1.2
    for name, one in found["parameters"].items():
        assert one["real"] == pytest.approx(one["predicted"], rel=0.3), name
    shares = found["shares_of_limits"]
    assert shares["position"] <= 1 and shares["command"] <= 1
    assert shares["p_min"] >= 1 and shares["p_max"] <= 1
