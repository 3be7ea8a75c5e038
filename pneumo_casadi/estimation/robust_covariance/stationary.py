"""Covariance under residuals that are correlated in time, but alike all along."""

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from pneumo_casadi.estimation.robust_covariance.newey_west import default_lags
from pneumo_casadi.parameters import FloatArray

ComplexArray = NDArray[np.complex128]


def stationary_sandwich(
    inverse: FloatArray,
    rows: FloatArray,
    residual: FloatArray,
    equation: NDArray[np.intp],
    instant: NDArray[np.intp],
    lags: int | None = None,
) -> FloatArray:
    """Return H⁻¹ Jᵀ Ω J H⁻¹, with Ω from the autocovariances of the residuals.

    With the residuals r_e of equation e, which is observed at the instants k of a set,

    Ω between equations e and f at j instants apart is (1 - j/(L+1)) γ_ef(j) up to L, then zero,
    γ_ef(j) = mean of r_e(k) r_f(k-j) over all k observed, / √((1 - h_e)(1 - h_f)),

    where h_e is the mean leverage of the rows of e, the share of r_e² that the fit removes. All
    rows tell γ, so that a parameter on which few rows bear has a standard deviation of little
    scatter, unlike the one by Newey and West; but noise that differs along the record is not seen.

    Parameters
    ----------
    inverse : (n, n) array
        H⁻¹.
    rows : (r, n) array
        J: weighted rows.
    residual : (r,) array
        Weighted residuals.
    equation, instant : (r,) array of int
        Equation and instant of each row.
    lags : int, optional
        L; by default as in `newey_west_sandwich`.

    Returns
    -------
    (n, n) array

    Examples
    --------
    >>> e = np.random.default_rng(0).normal(size=4000)
    >>> ones, same = np.ones((4000, 1)), np.zeros(4000, dtype=np.intp)
    >>> C = stationary_sandwich(np.eye(1) / 4000, ones, e, same, np.arange(4000), lags=5)
    >>> round(float(C[0, 0]) * 4000, 1)
    1.0
    """
    time = instant - instant.min()
    T, ne = int(time.max()) + 1, int(equation.max()) + 1
    if lags is None:
        lags = default_lags(np.unique(instant).size)
    size = fft.next_fast_len(T + lags, real=True)
    influence = rows @ inverse
    leverage = np.einsum("ij,ij->i", influence, rows)
    counts = np.maximum(np.bincount(equation, minlength=ne), 1)
    kept = np.maximum(1 - np.bincount(equation, leverage, ne) / counts, 1 / counts)
    stacked = np.zeros((ne, T, 2 + rows.shape[1]))
    stacked[equation, time, 0] = residual / np.sqrt(
        np.maximum(kept[equation], 1 / counts[equation])
    )
    stacked[equation, time, 1] = 1.0
    stacked[equation, time, 2:] = influence
    spectra = fft.rfft(stacked, size, axis=1)
    products, observed = (
        fft.irfft(spectra[:, None, :, i] * spectra[None, :, :, i].conj(), size) for i in (0, 1)
    )
    lag = np.minimum(np.arange(size), size - np.arange(size))
    taper = np.maximum(1 - lag / (lags + 1), 0.0)
    gamma = np.where(observed > 0.5, products / np.maximum(observed, 1.0), 0.0) * taper
    return _summed(spectra[:, :, 2:], fft.rfft(gamma), size)


def _summed(influence: ComplexArray, omega: ComplexArray, size: int) -> FloatArray:
    """Return Σ a_e(k)ᵀ Ω_ef(k - l) a_f(l) from the spectra of influences and autocovariances."""
    through = np.einsum("efw,fwn->ewn", omega, influence)
    per_frequency = np.einsum("ewm,ewn->wmn", influence.conj(), through).real
    once = np.full(len(per_frequency), 2.0)  # negative frequencies too
    once[0] = 1.0
    if size % 2 == 0:
        once[-1] = 1.0
    total: FloatArray = np.tensordot(once, per_frequency, 1) / size
    return (total + total.T) / 2
