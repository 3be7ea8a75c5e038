"""Blocks of residuals put together anew: how long they must be, and which are drawn."""

import numpy as np

from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.statistics import autocorrelation

#: A record is cut into at least so many blocks.
FEWEST_BLOCKS = 10


def block_length(residuals: FloatArray) -> int:
    """Return how long blocks must be for the correlation of residuals to survive in them.

    Parameters
    ----------
    residuals : (nc, K) array
        Channels of one record; the most correlated one decides.

    Returns
    -------
    int
        Steps, for the circular block bootstrap: that of Politis and White (2004), with the
        correction of Patton, Politis and White (2009), at most a tenth of the record.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> e = rng.normal(size=(1, 4000))
    >>> slow = np.array([np.convolve(e[0], np.ones(20), "valid")])
    >>> block_length(e), block_length(slow)
    (1, 67)
    """
    longest = max(1, residuals.shape[1] // FEWEST_BLOCKS)
    wanted = max(_politis_white(e) for e in residuals)
    return int(min(longest, max(1, np.ceil(wanted))))


def _politis_white(e: FloatArray) -> float:
    """Return the block length of least error for the variance of the mean of one channel.

    Correlation counts up to twice the lag after which several successive ones are inside the
    band of white noise, tapered by a flat-topped window.
    """
    K = e.size
    if K < 10 or float(np.ptp(e)) == 0:
        return 1.0
    quiet = max(5, int(np.ceil(np.sqrt(np.log10(K)))))
    most = min(K - 1, int(np.ceil(np.sqrt(K))) + quiet)
    rho = autocorrelation(e, most)
    band = 2 * np.sqrt(np.log10(K) / K)
    loud = np.flatnonzero(np.abs(rho[1:]) >= band) + 1
    last = 0
    for lag in loud:
        if lag - last > quiet:
            break
        last = int(lag)
    M = min(2 * last, most)
    if M == 0:
        return 1.0
    lags = np.arange(1, M + 1)
    taper = np.minimum(1.0, 2 * (1 - lags / M))
    G = 2 * float(np.sum(taper * lags * rho[1 : M + 1]))
    g_0 = 1 + 2 * float(np.sum(taper * rho[1 : M + 1]))
    return float((1.5 * (G / g_0) ** 2) ** (1 / 3) * K ** (1 / 3)) if g_0 > 0 else 1.0


def circular_blocks(rng: np.random.Generator, K: int, length: int) -> np.ndarray:
    """Return K indices in blocks of successive ones, the end joined to the start.

    Politis and Romano (1992): every residual is drawn equally often, those at the ends too.

    Examples
    --------
    >>> circular_blocks(np.random.default_rng(1), 6, 3)
    array([2, 3, 4, 3, 4, 5])
    """
    starts = rng.integers(0, K, size=-(-K // length))
    found: np.ndarray = ((starts[:, None] + np.arange(length)) % K).ravel()[:K]
    return found
