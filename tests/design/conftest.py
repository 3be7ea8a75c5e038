"""A servo axis of known truth, and what its limits are."""

import numpy as np
import pytest

from pneumo_casadi.design import Limits, Reference

#: Noise of one sample of p_P, p_N and x.
SIGMA = np.array([150.0, 150.0, 1.5e-5])


@pytest.fixture(scope="session")
def sigma():
    return SIGMA


@pytest.fixture(scope="session")
def limits(made):
    bench = made.BENCH
    return Limits(0.4 * bench.stroke, 0.8, bench.p_ext, bench.p_supply, 3.0, 0.1)


@pytest.fixture(scope="session")
def recorded():
    """Two seconds of small squares at 1 kHz: an experiment that leaves much to be desired."""
    t = np.arange(2000) / 1000.0
    return Reference(1e-3, 0.03 * np.sign(np.sin(2 * np.pi * 0.5 * t) + 1e-9), np.zeros(2000))
