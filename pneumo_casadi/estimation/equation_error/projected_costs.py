"""Costs of starts, from each of which the parameters known so far have already given way."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneumo_casadi.estimation.equation_error.problem import DAMPING, Linearised, Problem, Trial
from pneumo_casadi.model.machine_code.lane_code import LANES
from pneumo_casadi.parameters import FloatArray


@dataclass(frozen=True, eq=False)
class ProjectedCosts:
    """Costs at some values of the effects, after one linear step of all other parameters.

    Parameters fitted without an effect have taken on what it does as far as they can. Where it is
    tried beside them as they are, the true value may cost more than a wrong one that disturbs them
    less. Here they move for every value tried, by the step of Gauss and Newton from the one point
    at which the derivatives A are known, within their bounds (variable projection, Golub and
    Pereyra 1973, held to one linearisation)::

        δ = −(H + λ diag H)⁻¹ Aᵀ e(θ),   e ← e(θ) + A δ,   H = AᵀA

    Parameters
    ----------
    problem : Problem
        The cost.
    origin : (nθ,) array
        Where the derivatives are taken.
    held : collection of str
        Free parameters that do not move: those that are tried.
    """

    problem: Problem
    origin: FloatArray
    held: Collection[str] = ()

    def __call__(self, variants: Sequence[FloatArray]) -> list[float]:
        """Return the cost at some values of all parameters; infinite where it is no number."""
        costs: list[float] = []
        with np.errstate(over="ignore", invalid="ignore"):  # a start may run away
            for k in range(0, len(variants), LANES):
                some = variants[k : k + LANES]
                residuals = self.problem.residuals_of(some)
                costs += [self._cost(r, theta) for r, theta in zip(residuals, some, strict=True)]
        return [cost if np.isfinite(cost) else np.inf for cost in costs]

    def _cost(self, r: Sequence[FloatArray], theta: FloatArray) -> float:
        problem, moves = self.problem, self._moves
        e = problem.weighted(r, theta, self._sigma)
        delta = -(self._gain @ (self._A.T @ e))
        at = theta[moves]
        reached = np.clip(at + delta * self._scales, *(bound[moves] for bound in self._bounds))
        e = e + self._A @ ((reached - at) / self._scales)
        rows = problem.weights.size
        squares = np.sum(e[:rows].reshape(problem.weights.shape) ** 2, axis=1) / problem.n_rows
        floor = problem.residual_floor / self._sigma
        sigma = self._sigma * np.sqrt(squares + floor**2)
        return float(problem.n_rows @ np.log(sigma) + 0.5 * np.sum(e[rows:] ** 2))

    @cached_property
    def _linear(self) -> Linearised:
        return self.problem.linearise(Trial(self.origin, np.inf))

    @cached_property
    def _sigma(self) -> FloatArray:
        return self.problem.sigma(self.problem.residuals(self.origin))

    @cached_property
    def _columns(self) -> list[int]:
        """Columns of the derivatives whose parameters move."""
        return [k for k, name in enumerate(self.problem.model.free) if name not in self.held]

    @cached_property
    def _moves(self) -> list[int]:
        """The same parameters among all."""
        return [self.problem.free[k] for k in self._columns]

    @cached_property
    def _scales(self) -> FloatArray:
        return np.asarray(self.problem.scales[self._columns])

    @cached_property
    def _bounds(self) -> tuple[FloatArray, FloatArray]:
        parameters = self.problem.model.axis.parameters
        return parameters.lower, parameters.upper

    @cached_property
    def _A(self) -> FloatArray:
        return np.asarray(self._linear.A[:, self._columns])

    @cached_property
    def _gain(self) -> FloatArray:
        """(H + λ diag H)⁻¹ of what moves."""
        H = self._A.T @ self._A
        diagonal = np.diag(H)
        floor = 1e-12 * diagonal.max(initial=0.0)
        damped = H + DAMPING.start * np.diag(np.maximum(diagonal, floor))
        return np.asarray(np.linalg.pinv(damped, hermitian=True))
