"""Costs of starts, from each of which the parameters known so far have already given way."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneumo_casadi.estimation.equation_error.problem import DAMPING, Linearised, Problem, Trial
from pneumo_casadi.estimation.gauss_newton import minimise_in_box
from pneumo_casadi.model.machine_code.lane_code import LANES
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
        costs: list[float] = []
        with np.errstate(over="ignore", invalid="ignore"):  # a start may run away
            moves = bool(self._columns) and bool(np.isfinite(self._linear.A).all())
            for k in range(0, len(variants), LANES):
                some = variants[k : k + LANES]
                for r, theta in zip(self.problem.residuals_of(some), some, strict=True):
                    plain = self.problem.cost(r, theta)
                    moved = self._moved(r, theta) if moves and np.isfinite(plain) else np.inf
                    costs.append(min(plain, moved) if np.isfinite(plain) else np.inf)
        return costs

    def _moved(self, r: Sequence[FloatArray], theta: FloatArray) -> float:
        """Return the cost after the step from θ, whose residuals are r."""
        problem, A = self.problem, self._A
        e = problem.weighted(r, theta, self._sigma)
        at, parameters = theta[self._moving], problem.model.axis.parameters
        lower, upper = (
            (bound[self._moving] - at) / self._scales
            for bound in (parameters.lower, parameters.upper)
        )
        e = e + A @ minimise_in_box(self._damped, -A.T @ e, lower, upper)
        rows = problem.weights.size
        squares = np.sum(e[:rows].reshape(problem.weights.shape) ** 2, axis=1) / problem.n_rows
        sigma = np.sqrt(squares * self._sigma**2 + problem.residual_floor**2)
        return float(problem.n_rows @ np.log(sigma) + 0.5 * np.sum(e[rows:] ** 2))

    @cached_property
    def _linear(self) -> Linearised:
        return self.problem.linearise(Trial(self.origin, np.inf))

    @cached_property
    def _sigma(self) -> FloatArray:
        """Standard deviations that weigh the residuals, (ne,)."""
        return self.problem.sigma(self.problem.residuals(self.origin))

    @cached_property
    def _columns(self) -> list[int]:
        """Columns of the derivatives whose parameters move."""
        return [k for k, name in enumerate(self.problem.model.free) if name not in self.held]

    @cached_property
    def _moving(self) -> list[int]:
        """The same parameters among all."""
        return [self.problem.free[k] for k in self._columns]

    @cached_property
    def _scales(self) -> FloatArray:
        return np.asarray(self.problem.scales[self._columns])

    @cached_property
    def _A(self) -> FloatArray:
        return np.asarray(self._linear.A[:, self._columns])

    @cached_property
    def _damped(self) -> FloatArray:
        """AᵀA, with the damping with which fits begin."""
        H = self._A.T @ self._A
        diagonal = np.diag(H)
        return np.asarray(H + DAMPING.start * np.diag(np.maximum(diagonal, 1e-12 * diagonal.max())))
