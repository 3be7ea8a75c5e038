"""The size of a covariance as one number."""

from enum import Enum

import numpy as np

from pneumo_casadi.parameters import FloatArray


class Criterion(Enum):
    """What is made small: all are standard deviations over the parameters' values [1]."""

    D = "D"
    """The volume of the confidence region: det(C)^(1/2n), the geometric mean of its half axes."""
    A = "A"
    """The mean variance: √(trace(C)/n)."""
    E = "E"
    """The worst direction: the square root of the largest eigenvalue."""

    def of(self, relative: FloatArray) -> float:
        """Return the size of a covariance of parameters divided by their values, shape (n, n).

        Infinite where a parameter is not informed.

        Examples
        --------
        >>> C = np.diag([1e-4, 4e-4])
        >>> [round(criterion.of(C), 4) for criterion in Criterion]
        [0.0141, 0.0158, 0.02]
        """
        if not np.isfinite(relative).all():
            return float("inf")
        half_axes = np.sqrt(np.maximum(np.linalg.eigvalsh(relative), 0.0))
        if self is Criterion.A:
            return float(np.sqrt(np.mean(half_axes**2)))
        if self is Criterion.E:
            return float(half_axes.max())
        if half_axes.min() <= 0:
            return 0.0
        return float(np.exp(np.mean(np.log(half_axes))))
