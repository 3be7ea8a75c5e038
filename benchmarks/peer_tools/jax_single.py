"""Single shooting in JAX: a scan over the samples, Levenberg and Marquardt's damped steps."""

from peer_tools import jax_shooting
from peer_tools.estimation import Estimation
from peer_tools.jax_kernel import Intervals

version, solve = jax_shooting.version, jax_shooting.solve


def build(problem: Estimation) -> tuple[Intervals, int]:
    """One interval is one window; windows run side by side by `vmap`."""
    return jax_shooting.build(problem, None)
