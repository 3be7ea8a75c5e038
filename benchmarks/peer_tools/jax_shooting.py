"""Multiple shooting in JAX: intervals side by side by `vmap`, condensed Gauss-Newton in NumPy."""

import jax

from peer_tools import gauss_newton
from peer_tools.estimation import Answer, Estimation
from peer_tools.jax_kernel import Intervals

#: Longest interval [s].
INTERVAL = 0.1


def version() -> str:
    """Return the tool's version."""
    return jax.__version__


def build(problem: Estimation, interval: float | None = INTERVAL) -> tuple[Intervals, int]:
    """Cut the intervals; JAX traces and compiles, or loads what it compiled, at the first call."""
    samples = gauss_newton.interval_samples(problem, interval)
    return Intervals(problem, samples), samples


def solve(problem: Estimation, built: tuple[Intervals, int]) -> Answer:
    """Take full steps from the measured states; damped ones where an interval is a window."""
    intervals, samples = built
    return gauss_newton.solve(problem, intervals.linearise, samples)
