"""The wider of two robust covariances, for rows that are few."""

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.estimation.robust_covariance.newey_west import newey_west_sandwich
from pneumo_casadi.estimation.robust_covariance.stationary import stationary_sandwich
from pneumo_casadi.parameters import FloatArray


def wider_sandwich(
    inverse: FloatArray,
    rows: FloatArray,
    residual: FloatArray,
    equation: NDArray[np.intp],
    instant: NDArray[np.intp],
) -> FloatArray:
    """Return the covariance by Newey and West, no standard deviation below the stationary one.

    Parameters
    ----------
    inverse, rows, residual, equation, instant
        As in `stationary_sandwich`.

    Returns
    -------
    (n, n) array
    """
    covariance = newey_west_sandwich(inverse, rows * residual[:, None], instant)
    own = np.diag(covariance)
    others = np.diag(stationary_sandwich(inverse, rows, residual, equation, instant))
    widening = np.sqrt(np.divide(others, own, out=np.ones(own.size), where=others > own))
    return np.asarray(covariance * np.outer(widening, widening))
