"""Quantities derived from estimates, with their covariance by the delta method."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.wls.arrays import read_only
from pneumo_casadi.parameters import FloatArray


class Estimates(Protocol):
    """Named estimates with a covariance."""

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters, in order."""

    @property
    def estimate(self) -> FloatArray:
        """Values, shape (n,)."""

    @property
    def covariance(self) -> FloatArray:
        """Shape (n, n)."""


@dataclass(frozen=True, slots=True, eq=False)
class DerivedEstimates:
    """Values derived from estimates.

    Parameters
    ----------
    names : tuple of str
        Of the derived quantities.
    values : (m,) array
        In the units that the combination gives.
    covariance : (m, m) array
        To first order.
    """

    names: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray

    @property
    def std(self) -> FloatArray:
        """Standard deviations, shape (m,)."""
        return np.sqrt(np.diag(self.covariance))

    def as_dict(self) -> dict[str, dict[str, float]]:
        """Return ``{name: {"value": ..., "std": ...}}``."""
        return {
            name: {"value": float(value), "std": float(std)}
            for name, value, std in zip(self.names, self.values, self.std, strict=True)
        }


def linear_combinations(
    estimates: Estimates,
    combinations: Mapping[str, Mapping[str, float]],
    *,
    covariance: FloatArray | None = None,
) -> DerivedEstimates:
    """Derive linear combinations of estimates with their exact covariance A C Aᵀ.

    Parameters
    ----------
    estimates : Estimates
        A fit or its result.
    combinations : mapping
        For each new name the coefficients by parameter, for example
        ``{"F_c": {"F_c_plus": 0.5, "F_c_minus": 0.5}}``.
    covariance : (n, n) array, optional
        By default that of eq. 16; give ``covariance_hac`` where residuals are correlated.

    Returns
    -------
    DerivedEstimates

    Raises
    ------
    ModelError
        If a parameter was not estimated.
    """
    A = np.zeros((len(combinations), len(estimates.names)))
    for row, (name, coefficients) in zip(A, combinations.items(), strict=True):
        for parameter, coefficient in coefficients.items():
            row[_position(estimates, parameter, name)] += coefficient
    C = estimates.covariance if covariance is None else covariance
    values = A @ estimates.estimate
    return DerivedEstimates(tuple(combinations), read_only(values), read_only(A @ C @ A.T))


def ratios(
    estimates: Estimates,
    pairs: Mapping[str, tuple[str, str]],
    *,
    covariance: FloatArray | None = None,
) -> DerivedEstimates:
    """Derive ratios of estimates, with the covariance of the delta method.

    Parameters
    ----------
    estimates : Estimates
        A fit or its result.
    pairs : mapping of str to (str, str)
        For each new name numerator and denominator, for example
        ``{"k_P": ("X_s3", "X_s2")}``.
    covariance : (n, n) array, optional
        By default that of eq. 16.

    Returns
    -------
    DerivedEstimates

    Raises
    ------
    ModelError
        If a parameter was not estimated.
    """
    X = estimates.estimate
    G = np.zeros((len(pairs), X.size))
    values = np.zeros(len(pairs))
    for i, (name, (top, bottom)) in enumerate(pairs.items()):
        a, b = _position(estimates, top, name), _position(estimates, bottom, name)
        values[i] = X[a] / X[b]
        G[i, a] += 1 / X[b]
        G[i, b] -= X[a] / X[b] ** 2
    C = estimates.covariance if covariance is None else covariance
    return DerivedEstimates(tuple(pairs), read_only(values), read_only(G @ C @ G.T))


def _position(estimates: Estimates, parameter: str, name: str) -> int:
    if parameter not in estimates.names:
        raise ModelError(
            f"{name}: {parameter} was not estimated; there are {', '.join(estimates.names)}"
        )
    return estimates.names.index(parameter)
