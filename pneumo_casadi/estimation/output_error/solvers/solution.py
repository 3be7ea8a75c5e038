"""What every solver of the output-error problem returns."""

from dataclasses import dataclass, replace

import numpy as np

from pneumo_casadi.estimation.output_error.shooting.condensing import Linearised
from pneumo_casadi.estimation.output_error.shooting.problem import Problem, Unknowns
from pneumo_casadi.parameters import FloatArray

#: Relative change of a noise estimate below which it has settled.
SETTLED = 0.01


@dataclass(frozen=True, slots=True)
class Solution:
    """Where a solver stopped, and why.

    Parameters
    ----------
    point : Unknowns
        The last point.
    m : (ny, n_blocks) array
        Mean outputs of the model there.
    sigma : (ny,) array
        Noise of one sample of each output at the end.
    status : str
        ``"converged"`` or what went wrong.
    iterations : int
        Iterations taken.
    linear : Linearised or None
        The problem linearised at the point with this noise, where the solver has it.
    """

    point: Unknowns
    m: FloatArray
    sigma: FloatArray
    status: str
    iterations: int
    linear: Linearised | None = None

    def after(self, iterations: int) -> "Solution":
        """Return the solution with the iterations that came before it."""
        return replace(self, iterations=self.iterations + iterations)


def residual_sigma(problem: Problem, m: FloatArray) -> FloatArray:
    """Return the noise of one sample from residuals of block means, degrees of freedom counted."""
    e = problem.y - m
    fitted = len(problem.free) + problem.model.n_initial * len(problem.segments)
    dof = max(1.0, e.shape[1] - fitted / e.shape[0])
    with np.errstate(over="ignore"):  # residuals of a model that ran away are infinite
        sigma: FloatArray = np.sqrt(problem.n * np.sum(e**2, axis=1) / dof)
    return sigma


def new_sigma(problem: Problem, m: FloatArray, sigma: FloatArray) -> FloatArray | None:
    """Return the noise that the residuals show, or None where `sigma` has settled."""
    new = residual_sigma(problem, m)
    return new if bool(np.any(np.abs(new / sigma - 1) > SETTLED)) else None


def misfit(problem: Problem, m: FloatArray, sigma: FloatArray) -> float:
    """Return the root mean square of the residuals over σ, at least one."""
    with np.errstate(over="ignore"):
        e = (problem.y - m) / sigma[:, None]
        return float(np.sqrt(max(1.0, problem.n * float(np.mean(e**2)))))
