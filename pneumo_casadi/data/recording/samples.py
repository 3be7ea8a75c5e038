"""What the samples of one channel show by themselves: noise, quanta, equal and lone values."""

import numpy as np
import scipy  # its submodules are loaded at first use

from pneumo_casadi.parameters import FloatArray

NORMAL_MAD = 1.4826  # standard deviation of a normal distribution over its median deviation
ROWS_FOR_NOISE = 50_000  # as many tell a standard deviation to 0.5 %
NEIGHBOURS = 20
"""Steps on each side that a step is compared with: the largest of so many, of noise alone, is three
times its sigma."""


def quantisation_step(values: FloatArray) -> float:
    """Return the smallest step between neighbouring samples, 0 for a constant.

    Examples
    --------
    >>> quantisation_step(np.array([0.0, 0.5, 0.5, 2.0]))
    0.5
    """
    differences = np.abs(np.diff(values))
    moved = differences[differences > 1e-12 * np.abs(values).max()]
    return float(moved.min()) if moved.size else 0.0


def longest_run(values: FloatArray) -> tuple[int, int]:
    """Return start and length of the longest stretch of equal samples.

    Examples
    --------
    >>> longest_run(np.array([1.0, 2.0, 2.0, 2.0, 3.0]))
    (1, 3)
    """
    starts = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1, [values.size]])
    lengths = np.diff(starts)
    k = int(lengths.argmax())
    return int(starts[k]), int(lengths[k])


def noise_of(values: FloatArray) -> float:
    """Return the standard deviation of white noise on a smooth signal.

    From the median of the fourth differences, whose variance is 70 σ²: the signal itself does not
    show in them where it is sampled well above its bandwidth.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> smooth = np.sin(np.linspace(0, 30, 20_000))
    >>> round(noise_of(smooth + 1e-3 * rng.standard_normal(20_000)), 4)
    0.001
    """
    differences = np.diff(values, 4)
    if differences.size > ROWS_FOR_NOISE:  # at uneven steps: a sensor may be read every n-th row
        rows = np.linspace(0, differences.size - 1, ROWS_FOR_NOISE).astype(np.intp)
        differences = differences[rows]
    deviation = float(np.median(np.abs(differences - np.median(differences))))
    return NORMAL_MAD * deviation / float(np.sqrt(70.0))


def largest_around(size: FloatArray, own: int) -> tuple[FloatArray, FloatArray]:
    """Return the largest of the steps before and after, without the `own` ones from each on.

    Shape as `size`, less own - 1; steps beyond the ends count as 0.
    """
    padded = np.concatenate([np.zeros(NEIGHBOURS), size, np.zeros(NEIGHBOURS)])
    # Centred windows: element k of the result covers NEIGHBOURS elements from k on.
    largest = scipy.ndimage.maximum_filter1d(padded, NEIGHBOURS, mode="constant")[NEIGHBOURS // 2 :]
    count = size.size - own + 1
    return largest[:count], largest[NEIGHBOURS + own : NEIGHBOURS + own + count]
