"""Robust (sandwich) covariance of least-squares estimates.

With the residuals r, their Jacobian J and the scores g = Jᵀr, the covariance of the estimates is

    C = H⁻¹ S H⁻¹,   H = JᵀJ,   S = covariance of Σ g,

whatever the variance and the correlation of the residuals. For white residuals S = σ² H and C is
the usual σ² H⁻¹. Three estimators of S are used:

- Weighted least squares and equation error: Newey and West (`newey_west_sandwich`). Their rows are
  few, because they are decimated, and this is the standard deviation that the literature on
  regression gives. A parameter that few rows determine, as the mass, has so uncertain a standard
  deviation that too many intervals are short: the wider of this one and that of residuals alike
  all along (`stationary_sandwich`) is told (`wider_sandwich`).
- Output error: variances of batch sums (`batch_sandwich`). Its residuals are many and correlated
  for an unknown time, from one block to several seconds. Batches choose their length from the
  data, and count what the fit has removed from the residuals, which a kernel estimator does not.
"""

from pneumo_casadi.estimation.robust_covariance.batches import batch_sandwich
from pneumo_casadi.estimation.robust_covariance.newey_west import default_lags, newey_west_sandwich
from pneumo_casadi.estimation.robust_covariance.stationary import stationary_sandwich
from pneumo_casadi.estimation.robust_covariance.wider import wider_sandwich

__all__ = [
    "batch_sandwich",
    "default_lags",
    "newey_west_sandwich",
    "stationary_sandwich",
    "wider_sandwich",
]
