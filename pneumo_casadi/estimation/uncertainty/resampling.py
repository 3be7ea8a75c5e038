"""Blocks of residuals put together anew: how long, what their ends cost, and which are drawn."""

import numpy as np

from pneumo_casadi.estimation.statistics import autocorrelation
from pneumo_casadi.parameters import FloatArray

#: A record is cut into at least so many blocks.
FEWEST_BLOCKS = 10
#: Blocks are so many times as long as is best for a variance: an interval suffers more from the
#: correlation that the ends of blocks cut than from the scatter of fewer blocks.
LONGER = 2.0


def block_length(residuals: FloatArray) -> int:
    """Return how long blocks must be for the correlation of residuals to survive in them.

    Parameters
    ----------
    residuals : (nc, K) array
        Channels of one record; the most correlated one decides.

    Returns
    -------
    int
        Steps, for the circular block bootstrap: twice those of Politis and White (2004), with the
        correction of Patton, Politis and White (2009), at most a tenth of the record.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> e = rng.normal(size=(1, 4000))
    >>> slow = np.array([np.convolve(e[0], np.ones(20), "valid")])
    >>> block_length(e), block_length(slow)
    (1, 134)
    """
    longest = max(1, residuals.shape[1] // FEWEST_BLOCKS)
    wanted = max(_politis_white(e) for e in residuals)
    return int(min(longest, max(1, np.ceil(LONGER * wanted))))


def retained_variance(residuals: FloatArray, length: int) -> FloatArray:
    """Return how much of the variance of slow sums survives where blocks cut correlation.

    Two residuals h steps apart are in one block of length L with probability 1 - h/L. What is lost
    is small beside what is kept for long blocks only: it falls as 1/L.

    Parameters
    ----------
    residuals : (nc, K) array
        Channels of one record.
    length : int
        Of a block.

    Returns
    -------
    (nc,) array
        At most 1; above it, correlation is negative, and no residual is made smaller for that.

    Examples
    --------
    >>> e = np.random.default_rng(0).normal(size=4000)
    >>> slow = np.convolve(e, np.ones(20), "valid")[None]
    >>> [round(float(retained_variance(slow, length)[0]), 2) for length in (1, 20, 134)]
    [0.05, 0.66, 0.95]
    """
    kept = []
    for e in residuals:
        rho = _correlation(e)
        lags = np.arange(1, rho.size)
        whole = 1 + 2 * float(np.sum(rho[1:]))
        inside = 1 + 2 * float(np.sum(np.maximum(1 - lags / length, 0.0) * rho[1:]))
        kept.append(min(1.0, inside / whole) if whole > 0 else 1.0)
    return np.array(kept)


def _politis_white(e: FloatArray) -> float:
    """Return the block length of least error for the variance of the mean of one channel."""
    rho = _correlation(e)
    lags = np.arange(1, rho.size)
    G = 2 * float(np.sum(lags * rho[1:]))
    g_0 = 1 + 2 * float(np.sum(rho[1:]))
    return float((1.5 * (G / g_0) ** 2 * e.size) ** (1 / 3)) if g_0 > 0 else 1.0


def _correlation(e: FloatArray) -> FloatArray:
    """Return the autocorrelation of a channel as far as it counts, from lag 0.

    Up to twice the lag after which several successive ones are inside the band of white noise,
    tapered by a flat-topped window.
    """
    K = e.size
    if K < 10 or float(np.ptp(e)) == 0:
        return np.ones(1)
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
    taper = np.minimum(1.0, 2 * (1 - np.arange(M + 1) / max(M, 1)))
    tapered: FloatArray = taper * rho[: M + 1]
    return tapered


def draw_circular_blocks(rng: np.random.Generator, K: int, length: int) -> np.ndarray:
    """Return K indices in blocks of successive ones, the end joined to the start.

    Politis and Romano (1992): every residual is drawn equally often, those at the ends too.

    Examples
    --------
    >>> draw_circular_blocks(np.random.default_rng(1), 6, 3)
    array([2, 3, 4, 3, 4, 5])
    """
    starts = rng.integers(0, K, size=-(-K // length))
    indices: np.ndarray = ((starts[:, None] + np.arange(length)) % K).ravel()[:K]
    return indices
