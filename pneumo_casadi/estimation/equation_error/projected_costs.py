"""Costs of starts, from each of which the parameters known so far have already given way."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneumo_casadi.estimation.equation_error.problem import (
    DAMPING,
    Linearised,
    Problem,
    Trial,
    damped,
)
from pneumo_casadi.estimation.gauss_newton import minimise_in_box
from pneumo_casadi.parameters import FloatArray


@dataclass(frozen=True, eq=False)
class ProjectedCosts:
    """Costs at some values of an effect, after one linear step of the parameters known so far.

    Parameters fitted without an effect have taken on what it does as far as they can. Where it is
    tried beside them as they are, the true value may cost more than a wrong one that disturbs them
    less. Here they move for every value tried, by a step of Gauss and Newton within their bounds,
    with the derivatives A of one point. It is what variable projection (Golub and Pereyra 1973)
    would do, with one linearisation for all values::

        δ = argmin ½ |e(θ) + A δ|² + ½ λ δᵀ diag(AᵀA) δ,   e ← e(θ) + A δ

    Where that costs more than not to move, they do not.

    Parameters
    ----------
    problem : Problem
        The cost.
    origin : (nθ,) array
        Where the derivatives are taken.
    held : collection of str
        Free parameters that do not move: those of the effects that are tried.
    """

    problem: Problem
    origin: FloatArray
    held: Collection[str] = ()

    def __call__(self, variants: Sequence[FloatArray]) -> list[float]:
        """Return the cost at some values of all parameters; infinite where it is no number."""
        with np.errstate(over="ignore", invalid="ignore"):  # a start may run away
            residuals = self.problem.residuals_of(variants)
            return [self._cost(r, theta) for r, theta in zip(residuals, variants, strict=True)]

    def _cost(self, r: Sequence[FloatArray], theta: FloatArray) -> float:
        plain = self.problem.cost(r, theta)
        if not np.isfinite(plain):
            return np.inf
        return min(plain, self._moved(r, theta)) if self._moves else plain

    def _moved(self, r: Sequence[FloatArray], theta: FloatArray) -> float:
        """Return the cost after the step from θ, whose residuals are r."""
        problem, A, sigma = self.problem, self._A, self._linear.sigma
        e = problem.weighted(r, theta, sigma)
        lower, upper = (
            ((bound - theta[problem.free]) / problem.scales)[self._columns]
            for bound in problem.bounds
        )
        e = e + A @ minimise_in_box(self._damped, -A.T @ e, lower, upper)
        rows = problem.weights.size
        squares = np.sum(e[:rows].reshape(problem.weights.shape) ** 2, axis=1) / problem.n_rows
        left = np.sqrt(squares * sigma**2 + problem.residual_floor**2)
        return float(problem.n_rows @ np.log(left) + 0.5 * np.sum(e[rows:] ** 2))

    @cached_property
    def _linear(self) -> Linearised:
        return self.problem.linearise(Trial(self.origin, np.inf))

    @cached_property
    def _columns(self) -> list[int]:
        """Columns of the derivatives whose parameters move."""
        return [k for k, name in enumerate(self.problem.model.free) if name not in self.held]

    @cached_property
    def _moves(self) -> bool:
        """Whether a parameter can move: the derivatives may be no numbers."""
        return bool(self._columns) and bool(np.isfinite(self._A).all())

    @cached_property
    def _A(self) -> FloatArray:
        return np.asarray(self._linear.A[:, self._columns])

    @cached_property
    def _damped(self) -> FloatArray:
        """AᵀA, with the damping with which fits begin."""
        return damped(self._A.T @ self._A, DAMPING.start)
