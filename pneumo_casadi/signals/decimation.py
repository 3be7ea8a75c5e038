"""Parallel filtering: the same low-pass and decimation for Y and every column of W (eq. 13)."""

from collections.abc import Callable
from enum import Enum
from functools import cache

import numpy as np
import scipy  # its submodules are loaded at first use
from numpy.typing import ArrayLike, NDArray

from pneumo_casadi.errors import ModelError
from pneumo_casadi.parameters import FloatArray

#: Ripple of one pass of the Chebyshev low-pass [dB].
RIPPLE_DB = 0.05


class Decimation(Enum):
    """Low-pass ahead of the resampling, each without phase shift."""

    CHEBYSHEV = "Chebyshev type I, order 8, 0.05 dB, forward and backward"
    """What MATLAB's ``decimate`` does, and so the authors of the EMPS benchmark."""
    BUTTERWORTH = "Butterworth, order 4, forward and backward"
    FIR = "linear-phase FIR of 20 times the factor"


def parallel_decimate(
    columns: ArrayLike, factor: int, kind: Decimation = Decimation.CHEBYSHEV
) -> FloatArray:
    """Low-pass and resample all columns with one and the same linear operator.

    Because the operator is linear and common to all columns, edges included, a relation
    Y = W X that holds for the rows holds exactly for the decimated rows: the second filter of
    the paper (section 4.2) does not bias what is estimated, not even at the edges. Noise averages
    out less there: both ends are best multiplied by zero before, and continued by zeros.

    Parameters
    ----------
    columns : (N,) or (N, n) array
        Y and the columns of W.
    factor : int
        Keep one row in `factor`; 1 returns a copy.
    kind : Decimation, optional
        The low-pass. All have their edge at 0.8 times the new Nyquist frequency.

    Returns
    -------
    (ceil(N / factor),) or (ceil(N / factor), n) array
        Rows `decimated_rows` of the filtered columns.

    Raises
    ------
    ModelError
        If the factor is below 1, or the record too short for it.

    Examples
    --------
    >>> parallel_decimate(np.full(1000, 2.0), factor=10).round(6)[:3]
    array([2., 2., 2.])
    """
    values = np.asarray(columns, dtype=float)
    if factor < 1 or factor != int(factor):
        raise ModelError(f"decimation factor {factor} must be a whole number of at least 1")
    if factor == 1:
        return np.array(values)
    least = 20 * factor
    if values.shape[0] <= least:
        raise ModelError(
            f"{values.shape[0]} samples are too few to decimate by {factor}: "
            f"more than {least} are needed; lower the factor"
        )
    return np.asarray(_LOWPASS[kind](values, factor)[decimated_rows(values.shape[0], factor)])


def decimated_rows(N: int, factor: int) -> NDArray[np.intp]:
    """Return the rows that decimation keeps: every `factor`-th, the last one included.

    Parameters
    ----------
    N : int
        Number of rows before.
    factor : int
        Every `factor`-th row is kept.

    Examples
    --------
    >>> decimated_rows(10, 3)
    array([0, 3, 6, 9])
    """
    return np.arange((N - 1) % factor, N, factor, dtype=np.intp)


def passband_edge(factor: int, sampling_frequency: float) -> float:
    """Return the edge of the parallel low-pass, 0.8 times the new Nyquist frequency [Hz].

    Parameters
    ----------
    factor : int
        Every `factor`-th row is kept.
    sampling_frequency : float
        Before decimation [Hz].

    Examples
    --------
    >>> passband_edge(10, 1e3)
    40.0
    """
    return 0.8 * sampling_frequency / (2 * factor)


@cache
def _chebyshev_sections(factor: int) -> FloatArray:
    # Designing takes longer than filtering a short record, of which there may be hundreds.
    return np.asarray(scipy.signal.cheby1(8, RIPPLE_DB, 0.8 / factor, output="sos"))


def _chebyshev(values: FloatArray, factor: int) -> FloatArray:
    # Second-order sections stay accurate where (b, a) forms lose all digits. A Chebyshev filter
    # of even order passes a constant at the bottom of its ripple; dividing by that gain, which
    # MATLAB does not, leaves every estimate as it is and gives flows and efforts in true size.
    sections = _chebyshev_sections(factor)
    constant = 10 ** (-2 * RIPPLE_DB / 20)
    return np.asarray(scipy.signal.sosfiltfilt(sections, values, axis=0, padlen=24)) / constant


def _butterworth(values: FloatArray, factor: int) -> FloatArray:
    sections = scipy.signal.butter(4, 0.8 / factor, output="sos")
    return np.asarray(scipy.signal.sosfiltfilt(sections, values, axis=0, padlen=12))


def _fir(values: FloatArray, factor: int) -> FloatArray:
    taps = scipy.signal.firwin(20 * factor + 1, 0.8 / factor)
    half = 10 * factor
    padding = [(half, half)] + [(0, 0)] * (values.ndim - 1)
    # The mirror image through the end point is linear in the data, as in filtfilt.
    extended = np.pad(values, padding, mode="reflect", reflect_type="odd")
    shape = (-1, *(1,) * (values.ndim - 1))
    return np.asarray(scipy.signal.oaconvolve(extended, taps.reshape(shape), mode="valid", axes=0))


_LOWPASS: dict[Decimation, Callable[[FloatArray, int], FloatArray]] = {
    Decimation.CHEBYSHEV: _chebyshev,
    Decimation.BUTTERWORTH: _butterworth,
    Decimation.FIR: _fir,
}
