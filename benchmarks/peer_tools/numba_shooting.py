"""Multiple shooting by hand: numba for the intervals, condensed Gauss-Newton in NumPy."""

import numba

from peer_tools import gauss_newton
from peer_tools.estimation import Answer, Estimation
from peer_tools.numba_kernel import Intervals

#: Longest interval [s].
INTERVAL = 0.1


def version() -> str:
    """Return the tool's version."""
    return numba.__version__


def build(problem: Estimation) -> tuple[Intervals, int]:
    """Cut the intervals; numba compiles, or loads what it compiled, at the first call."""
    samples = gauss_newton.interval_samples(problem, INTERVAL)
    return Intervals(problem, samples), samples


def solve(problem: Estimation, built: tuple[Intervals, int]) -> Answer:
    """Take full steps from the measured states."""
    intervals, samples = built
    return gauss_newton.solve(problem, intervals.linearise, samples)
