"""Weighted linear least squares with its statistics (eq. 13, 15-17)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from pneumo_casadi.errors import FitError
from pneumo_casadi.estimation.robust_covariance import wider_sandwich
from pneumo_casadi.estimation.wls.arrays import read_only
from pneumo_casadi.estimation.wls.base_parameters import TOLERANCE, BaseParameters, base_parameters
from pneumo_casadi.estimation.wls.linear_system import LinearSystem
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.presentation import Brief


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LinearFit(Brief):
    """The weighted least squares solution of a linear system.

    Parameters
    ----------
    names : tuple of str
        Parameters, in order.
    estimate : (n,) array
        X̂.
    covariance : (n, n) array
        Eq. 16: as if the weighted residuals were white.
    covariance_hac : (n, n) array
        Residuals may be correlated in time and between equations: by Newey and West, each standard
        deviation at least that of residuals that are alike all along. Contains the errors that all
        rows share.
    condition_number : float
        Of the weighted W with its columns scaled to unit length.
    residual_std : mapping of str to float
        Of each equation, in its unit; the weights are their inverses.
    relative_error_percent : mapping of str to float
        100 ‖ρ‖ / ‖Y‖ of each equation, over the rows that were used.
    rows : mapping of str to int
        Rows used of each equation.
    residual : (r,) array
        Y - W X̂, rows that were not used included.
    base : BaseParameters
        Of the weighted W.
    """

    names: tuple[str, ...]
    estimate: FloatArray
    covariance: FloatArray
    covariance_hac: FloatArray
    condition_number: float
    residual_std: Mapping[str, float]
    relative_error_percent: Mapping[str, float]
    rows: Mapping[str, int]
    residual: FloatArray
    base: BaseParameters

    @property
    def std(self) -> FloatArray:
        """Standard deviations by eq. 16, shape (n,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def std_hac(self) -> FloatArray:
        """Standard deviations that allow for correlated residuals, shape (n,)."""
        return np.sqrt(np.diag(self.covariance_hac))

    @property
    def relative_std_percent(self) -> FloatArray:
        """100 σ / ``|X̂|`` (eq. 17), shape (n,); infinite where the estimate is zero."""
        with np.errstate(divide="ignore"):
            return np.asarray(100 * self.std / np.abs(self.estimate))


def solve_wls(
    system: LinearSystem,
    *,
    equation_std: Mapping[str, float] | None = None,
    iterations: int = 1,
    tolerance: float = TOLERANCE,
) -> LinearFit:
    """Solve a linear system by weighted least squares, with statistics.

    Each equation is weighted with the inverse of the standard deviation of its residual. That is
    not known beforehand: a first solution weights each equation by the size of its Y, and its
    residuals give the weights of the next, `iterations` times. Each equation's variance is
    ‖ρ_e‖² / (r_e - t_e), where t_e is the part of the n parameters which that equation
    determines (the trace of its block of the hat matrix).

    Parameters
    ----------
    system : LinearSystem
        Rows of all equations.
    equation_std : mapping of str to float, optional
        Residual standard deviation of each equation, if it is known; nothing is iterated then.
    iterations : int, optional
        Times that the weights are renewed.
    tolerance : float, optional
        Of the rank decision, see `base_parameters`.

    Returns
    -------
    LinearFit

    Raises
    ------
    FitError
        If W is rank deficient; the message names the combinations that can be estimated, and
        `partial` holds the `BaseParameters`.

    Examples
    --------
    >>> t = np.linspace(0, 1, 200)
    >>> W = np.column_stack([np.ones(200), t])
    >>> Y = W @ [2.0, -1.0] + 0.01 * np.random.default_rng(1).normal(size=200)
    >>> one = np.zeros(200, dtype=np.intp)
    >>> fit = solve_wls(LinearSystem(Y, W, ("a", "b"), ("line",), one, np.arange(200)))
    >>> bool(np.all(np.abs(fit.estimate - [2.0, -1.0]) < 3 * fit.std))
    True
    """
    labels = range(len(system.equations))
    if equation_std is not None:
        sigma = np.array([equation_std[name] for name in system.equations])
        iterations = 0
    else:
        sigma = np.array([_root_mean_square(system.Y[system.equation == e]) for e in labels])
    solution = _solve(system, sigma, tolerance)
    for _ in range(iterations):
        sigma = _equation_std(system, solution)
        solution = _solve(system, sigma, tolerance)
    return _statistics(system, solution, _equation_std(system, solution))


@dataclass(frozen=True, slots=True, eq=False)
class _Solution:
    estimate: FloatArray
    weight: FloatArray  # of each row, that of its equation
    leverage: FloatArray  # diagonal of the hat matrix
    inverse: FloatArray  # (Wᵀ W)⁻¹ of the weighted W
    condition: float
    base: BaseParameters


def _solve(system: LinearSystem, sigma: FloatArray, tolerance: float) -> _Solution:
    weight = 1.0 / np.where(sigma > 0, sigma, 1.0)[system.equation]
    W = system.W * weight[:, None]
    base = base_parameters(W, system.names, tolerance)
    if base.dependent:
        raise FitError(
            f"the observation matrix has rank {base.rank} for {len(system.names)} parameters: "
            f"{base.describe()}. {base.remedy}, or record a richer motion",
            partial=base,
        )
    size = np.linalg.norm(W, axis=0)
    U, s, Vt = linalg.svd(W / size, full_matrices=False)
    estimate = (Vt.T @ ((U.T @ (weight * system.Y)) / s)) / size
    root = (Vt.T / s) / size[:, None]
    leverage = np.einsum("ij,ij->i", U, U)
    return _Solution(estimate, weight, leverage, root @ root.T, float(s[0] / s[-1]), base)


def _equation_std(system: LinearSystem, solution: _Solution) -> FloatArray:
    rho = system.Y - system.W @ solution.estimate
    std = []
    for e in range(len(system.equations)):
        mine = system.equation == e
        free = np.count_nonzero(mine) - float(np.sum(solution.leverage[mine]))
        std.append(np.linalg.norm(rho[mine]) / np.sqrt(max(free, 1.0)))
    return np.array(std)


def _statistics(system: LinearSystem, solution: _Solution, sigma: FloatArray) -> LinearFit:
    residual = system.Y - system.W @ solution.estimate
    weighted = residual * solution.weight
    W = system.W * solution.weight[:, None]
    # The weights are relative: the residuals set the scale, as in eq. 15 and 16.
    free = system.Y.size - len(system.names)
    scale = float(weighted @ weighted) / free
    own, shared = _separate_shared_errors(system, solution, weighted, scale)
    correlated = wider_sandwich(solution.inverse, W, own, system.equation, system.instant)
    errors, rows = _by_equation(system, residual)
    return LinearFit(
        names=system.names,
        estimate=read_only(solution.estimate),
        covariance=read_only(scale * solution.inverse),
        covariance_hac=read_only(correlated + shared),
        condition_number=solution.condition,
        residual_std=dict(zip(system.equations, map(float, sigma), strict=True)),
        relative_error_percent=errors,
        rows=rows,
        residual=read_only(residual),
        base=solution.base,
    )


def _separate_shared_errors(
    system: LinearSystem, solution: _Solution, weighted: FloatArray, scale: float
) -> tuple[FloatArray, FloatArray]:
    """Return the weighted residual without errors that all rows share, and what they add.

    The shared errors e, of standard deviation one, move the estimate by S e; what they leave in
    the residual is estimated with this prior and taken out, since it would count twice.
    """
    W = system.W * solution.weight[:, None]
    D = system.errors_in_common * solution.weight[:, None]
    S = solution.inverse @ (W.T @ D)
    left = D - W @ S
    precision = left.T @ left + scale * np.eye(D.shape[1])
    return weighted - left @ np.linalg.solve(precision, left.T @ weighted), S @ S.T


def _by_equation(
    system: LinearSystem, residual: FloatArray
) -> tuple[dict[str, float], dict[str, int]]:
    errors: dict[str, float] = {}
    rows: dict[str, int] = {}
    for e, name in enumerate(system.equations):
        used = system.equation == e
        errors[name] = relative_error_percent(residual[used], system.Y[used])
        rows[name] = int(np.count_nonzero(used))
    return errors, rows


def relative_error_percent(residual: FloatArray, Y: FloatArray) -> float:
    """Return 100 ‖ρ‖ / ‖Y‖.

    Examples
    --------
    >>> relative_error_percent(np.array([0.3, 0.4]), np.array([3.0, 4.0]))
    10.0
    """
    size = float(np.linalg.norm(Y))
    return 100 * float(np.linalg.norm(residual)) / size if size > 0 else np.inf


def _root_mean_square(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 1.0
