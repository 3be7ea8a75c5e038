"""Robust covariance by Newey and West: sums over lags, for few rows."""

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.parameters import FloatArray


def newey_west_sandwich(
    inverse: FloatArray, scores: FloatArray, instant: NDArray[np.intp], lags: int | None = None
) -> FloatArray:
    """Return H⁻¹ S H⁻¹ with S by Newey and West (1987).

    With the scores g_k summed over all rows at instant k,

    S = T/(T - n) [Γ_0 + Σ_{j=1}^{L} (1 - j/(L+1)) (Γ_j + Γ_jᵀ)],   Γ_j = Σ_k g_k g_{k-j}ᵀ.

    Parameters
    ----------
    inverse : (n, n) array
        H⁻¹.
    scores : (r, n) array
        Weighted row times weighted residual.
    instant : (r,) array of int
        Instant of each row; missing instants count as zero.
    lags : int, optional
        L; by default 1.3 √T for T instants with data (Lazarus, Lewis, Stock and Watson 2018).

    Returns
    -------
    (n, n) array

    Examples
    --------
    >>> g = np.random.default_rng(0).normal(size=(4000, 1))
    >>> C = newey_west_sandwich(np.eye(1) / 4000, g, np.arange(4000), lags=5)
    >>> round(float(C[0, 0]) * 4000, 1)
    1.0
    """
    first = int(instant.min())
    g = np.zeros((int(instant.max()) - first + 1, scores.shape[1]))
    np.add.at(g, instant - first, scores)
    T = np.unique(instant).size
    if lags is None:
        lags = default_lags(T)
    S = g.T @ g
    for j in range(1, min(lags, g.shape[0] - 1) + 1):
        gamma = g[j:].T @ g[:-j]
        S += (1 - j / (lags + 1)) * (gamma + gamma.T)
    return np.asarray(inverse @ np.asarray(S * T / max(T - scores.shape[1], 1)) @ inverse)


def default_lags(T: int) -> int:
    """Return the number of lags that are summed for T instants, 1.3 √T.

    Examples
    --------
    >>> default_lags(2500)
    65
    """
    return int(np.ceil(1.3 * np.sqrt(T)))
