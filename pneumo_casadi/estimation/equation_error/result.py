"""Result of an equation-error fit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.residuals import balance_residuals
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray, Parameters


@dataclass(frozen=True, eq=False, repr=False)
class EquationErrorResult:
    """Parameters that minimise the residuals of the balances.

    Parameters
    ----------
    axis : Axis
        The model with the estimated parameters.
    names : tuple of str
        Estimated parameters, in the order of `covariance`.
    covariance : (n, n) array
        In SI units, residuals taken for white.
    cost : float
        Σ_e n_e log σ_e over the balances, plus half the sum of squares of the flow map's
        residuals: the negative log-likelihood but for a constant.
    residuals : tuple of (ne, m) array
        By record, rows that were not used included [Pa/s, Pa/s, N]; of a force-driven axis
        divided by the mass [m/s²].
    used : tuple of (ne, m) array of bool
        Rows that were used: those of the force balance only in motion.
    converged : bool
        False where the iterations were exhausted or no step lowered the cost.
    pace : float
        Decrease of the cost per iteration where these were exhausted, else 0.
    model : BalanceFunctions
        The balances as functions of the motion, compiled.
    """

    axis: Axis
    names: tuple[str, ...]
    covariance: FloatArray
    cost: float
    residuals: tuple[FloatArray, ...]
    used: tuple[NDArray[np.bool_], ...]
    converged: bool
    pace: float
    model: BalanceFunctions

    @property
    def parameters(self) -> Parameters:
        """All parameters with their estimated values."""
        return self.axis.parameters

    @property
    def std(self) -> dict[str, float]:
        """Standard deviation of each estimated parameter, in SI units."""
        variances = np.maximum(np.diag(self.covariance), 0.0)  # rounding may leave less than zero
        return dict(zip(self.names, np.sqrt(variances).tolist(), strict=True))

    def residuals_of(self, motion: SmoothedMotion) -> FloatArray:
        """Return the residuals (ne, m) along another motion, for example one held out."""
        return balance_residuals(self.model, motion, self.parameters.values)

    def __repr__(self) -> str:
        """Return the main figures in one line."""
        state = "converged" if self.converged else "not converged"
        rows = sum(int(used.sum()) for used in self.used)
        return (
            f"EquationErrorResult({state}, {len(self.names)} parameters, {rows} rows, "
            f"cost {self.cost:.6g})"
        )
