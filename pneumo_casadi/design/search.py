"""Search for the reference of an experiment by differential evolution, within limits.

The criterion is computed from sensitivities that CasADi derives and compiles. Its gradient is not
used: it would need second derivatives of the trajectory, each as expensive as an evaluation, and
the criterion is not smooth (sticking, a number of jumps that changes by one) and has several local
minima. Differential evolution copes with both. It starts from the paper's experiment.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, differential_evolution

from pneumo_casadi.design.space import Space
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.progress import Progress

#: References that live side by side.
POPULATION = 20
#: Beyond any logarithm of a criterion: a reference that exceeds limits, by its excess.
FORBIDDEN = 1e3
#: Best references that are looked at again in full.
FINALISTS = 5


@dataclass(frozen=True, slots=True)
class Candidate:
    """A point that keeps the limits, and its criterion (smaller is better)."""

    z: FloatArray
    value: float


@dataclass(frozen=True, slots=True)
class SearchResult:
    """Result of a search.

    Parameters
    ----------
    finalists : tuple of Candidate
        The best ones that keep the limits, best first; empty where none does.
    least_excess : float
        Smallest amount by which a reference exceeds the limits; 0 if one keeps them.
    history : tuple of float
        Best value after each evaluation, infinite until one keeps the limits.
    """

    finalists: tuple[Candidate, ...]
    least_excess: float
    history: tuple[float, ...]


def search(
    evaluate: Callable[[FloatArray], tuple[float, float]],
    space: Space,
    evaluations: int,
    seed: int,
    progress: Progress,
) -> SearchResult:
    """Search for the point of least value that exceeds no limit.

    Parameters
    ----------
    evaluate : callable
        ``evaluate(z) -> (excess, value)``; the value counts where the excess is 0.
    space : Space
        Search space; its start is in the first population.
    evaluations : int
        Approximate number of evaluations.
    seed : int
        Seed of the random numbers.
    progress : callable
        Called as ``progress(text, share)``.
    """
    seen: list[Candidate] = []
    history: list[float] = []
    excesses: list[float] = []

    def objective(z: FloatArray) -> float:
        excess, value = evaluate(z)
        excesses.append(excess)
        allowed = excess == 0.0 and np.isfinite(value)
        if allowed:
            seen.append(Candidate(z.copy(), value))
        history.append(min(history[-1] if history else np.inf, value if allowed else np.inf))
        progress("searching", min(1.0, len(history) / evaluations))
        return value if allowed else FORBIDDEN * (1.0 + excess)

    rng = np.random.default_rng(seed)
    first = rng.random((POPULATION, space.start.size))
    first[0] = space.start
    differential_evolution(
        objective,
        Bounds(np.zeros(space.start.size), np.ones(space.start.size)),
        init=first,
        maxiter=max(1, round(evaluations / POPULATION) - 1),
        strategy="best1bin",
        tol=0.0,
        polish=False,
        seed=np.random.default_rng([seed, 1]),
    )
    seen.sort(key=lambda candidate: candidate.value)
    return SearchResult(tuple(seen[:FINALISTS]), min(excesses), tuple(history))
