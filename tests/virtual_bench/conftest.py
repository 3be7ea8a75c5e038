"""Axes and runs of the virtual bench."""

from pathlib import Path

import pytest

from pneumo_casadi.virtual_bench import Experiment, random_axis


@pytest.fixture(scope="session")
def axis():
    return random_axis(3)


@pytest.fixture(scope="session")
def drive(axis):
    """Two seconds of chirp and squares at 1 kHz."""
    return Experiment.of("chirp_and_squares").excitation(axis, 1000.0, 2.0, seed=3)


@pytest.fixture(scope="session")
def bench_sanity(script):
    """The benchmark that sets the bench beside the model."""
    return script(Path(__file__).parents[2] / "benchmarks" / "bench_sanity.py")
