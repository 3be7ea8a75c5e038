"""Zero-phase Butterworth filter, differences, and what both do to an amplitude."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy  # its submodules are loaded at first use
from numpy.typing import ArrayLike

from pneumo_casadi.errors import ModelError
from pneumo_casadi.parameters import FloatArray

#: ``difference(values, dt)`` differentiates values (N,).
Difference = Callable[[FloatArray, float], FloatArray]


def zero_phase_lowpass(
    values: ArrayLike, cutoff: float, sampling_frequency: float, order: int = 4
) -> FloatArray:
    """Low-pass a signal with a Butterworth filter run forward and backward.

    Parameters
    ----------
    values : (N,) or (N, n) array
        Signals on a uniform clock, one a column.
    cutoff : float
        Frequency at which one pass attenuates by 3 dB, both by 6 dB [Hz].
    sampling_frequency : float
        [Hz]
    order : int, optional
        Order of one pass.

    Returns
    -------
    (N,) or (N, n) array
        Without phase shift. The first and last `settling_samples` suffer from the edges, where
        the signal is continued by its mirror image through the end point (as MATLAB's filtfilt
        does, and over as many samples).

    Raises
    ------
    ModelError
        If the cut-off is not between zero and half the sampling frequency, or the signal is
        shorter than its continuation at the edges.

    Examples
    --------
    >>> zero_phase_lowpass(np.ones(100), cutoff=10.0, sampling_frequency=1e3).round(9)[:3]
    array([1., 1., 1.])
    """
    signals = np.asarray(values, dtype=float)
    _check_cutoff(cutoff, sampling_frequency)
    padding = 3 * order
    if signals.shape[0] <= padding:
        raise ModelError(
            f"{signals.shape[0]} samples are too few to filter: order {order} needs more than "
            f"{padding}; give a longer record or a lower order"
        )
    sections = _sections(order, cutoff, sampling_frequency)
    filtered = scipy.signal.sosfiltfilt(sections, signals, axis=0, padlen=padding)
    return np.asarray(filtered, dtype=float)


@cache
def _sections(order: int, cutoff: float, sampling_frequency: float) -> FloatArray:
    """Return a low-pass as second-order sections: designing it costs more than a short record."""
    return np.asarray(scipy.signal.butter(order, cutoff, fs=sampling_frequency, output="sos"))


def central_difference(values: ArrayLike, dt: float) -> FloatArray:
    """Differentiate by central differences, one-sided at both ends.

    Parameters
    ----------
    values : (N,) or (N, n) array
        Signals on a uniform clock, one a column; N of at least 2.
    dt : float
        Sampling time [s].

    Returns
    -------
    (N,) or (N, n) array
        (y[k+1] - y[k-1]) / (2 dt), without phase shift; the end values are only of first order.

    Examples
    --------
    >>> central_difference([0.0, 1.0, 4.0, 9.0], dt=1.0)
    array([1., 2., 4., 5.])
    """
    return np.asarray(np.gradient(np.asarray(values, dtype=float), dt, axis=0), dtype=float)


#: Half of the antisymmetric stencil of the first derivative, of eighth order.
_STENCIL = (4 / 5, -1 / 5, 4 / 105, -1 / 280)


def smooth_difference(values: ArrayLike, dt: float) -> FloatArray:
    """Differentiate a signal that is smooth from sample to sample, by central differences.

    Parameters
    ----------
    values : (N,) array
        Signal on a uniform clock; N of at least 2.
    dt : float
        Sampling time [s].

    Returns
    -------
    (N,) array
        Differences of eighth order, without phase shift: a sine at a sixteenth of the sampling
        frequency loses a millionth of its derivative, where `central_difference` loses 2.5 %.
        The four values at either end are those of `central_difference`.

    Notes
    -----
    The noise of what is not smooth is amplified: filter before.

    Examples
    --------
    >>> t = 0.01 * np.arange(100)
    >>> float(np.abs(smooth_difference(np.sin(t), 0.01) - np.cos(t))[4:-4].max()) < 1e-12
    True
    """
    signal = np.asarray(values, dtype=float)
    slope, reach = central_difference(signal, dt), len(_STENCIL)
    if signal.size > 2 * reach:
        inner = signal.size - 2 * reach
        slope[reach:-reach] = (
            sum(
                weight * (signal[reach + k :][:inner] - signal[reach - k :][:inner])
                for k, weight in enumerate(_STENCIL, 1)
            )
            / dt
        )
    return slope


def settling_samples(
    cutoff: float, sampling_frequency: float, order: int = 4, tolerance: float = 1e-3
) -> int:
    """Return after how many samples the edge transient of the filter has died out.

    The transient decays at least like the slowest pole, ``|z|ⁿ``; n is the first sample at which
    this is below `tolerance`, plus two for a second central difference.

    Parameters
    ----------
    cutoff, sampling_frequency : float
        [Hz].
    order : int, optional
        Order of one pass.
    tolerance : float, optional
        Share of the transient that may be left [1].

    Examples
    --------
    >>> settling_samples(100.0, 1e3)
    33
    """
    _check_cutoff(cutoff, sampling_frequency)
    _, poles, _ = scipy.signal.butter(order, cutoff, fs=sampling_frequency, output="zpk")
    slowest = float(np.max(np.abs(poles)))
    return int(np.ceil(np.log(tolerance) / np.log(slowest))) + 2


@dataclass(frozen=True, slots=True)
class Distortion:
    """Relative change of a sine's amplitude by filter and differences; negative is loss.

    Parameters
    ----------
    frequency : float
        Frequency of the sine [Hz].
    position, velocity, acceleration : float
        For the filtered signal, its first and its second central difference, each against
        its ideal. Pressures fare as positions, their rates as velocities.
    """

    frequency: float
    position: float
    velocity: float
    acceleration: float


def amplitude_distortion(
    frequency: float, cutoff: float, sampling_frequency: float, order: int = 4
) -> Distortion:
    r"""Predict how filter and central differences distort the amplitude of a sine.

    The bilinear transform with prewarping maps the Butterworth magnitude to

    .. math:: |H(f)|^2 = \frac{1}{1 + (\tan(\pi f/f_s) / \tan(\pi f_c/f_s))^{2n}},

    which is the gain of the forward and backward passes together. A central difference of
    sin(ωt) is ω cos(ωt) · sin(ω/f_s)/(ω/f_s); the acceleration suffers that factor twice.

    Parameters
    ----------
    frequency : float
        Frequency of the sine [Hz].
    cutoff, sampling_frequency : float
        [Hz]
    order : int, optional
        Order of one pass.

    Returns
    -------
    Distortion

    Examples
    --------
    >>> d = amplitude_distortion(40.0, cutoff=100.0, sampling_frequency=1e3)
    >>> [round(100 * part, 3) for part in (d.position, d.velocity, d.acceleration)]
    [-0.052, -1.101, -2.139]
    """
    _check_cutoff(cutoff, sampling_frequency)
    ratio = np.tan(np.pi * frequency / sampling_frequency) / np.tan(
        np.pi * cutoff / sampling_frequency
    )
    lowpass = 1 / (1 + ratio ** (2 * order))
    # numpy's sinc(z) is sin(πz)/(πz)
    difference = float(np.sinc(2 * frequency / sampling_frequency))
    return Distortion(
        frequency=frequency,
        position=float(lowpass - 1),
        velocity=float(lowpass * difference - 1),
        acceleration=float(lowpass * difference**2 - 1),
    )


def least_cutoff(
    frequency: float, bound: float, sampling_frequency: float, order: int = 4
) -> float:
    """Return the lowest cut-off that keeps the distortion of an acceleration within a bound.

    Solves `amplitude_distortion` for the cut-off. The lowest is the best: every higher one
    distorts less than asked and lets more noise through.

    Parameters
    ----------
    frequency : float
        Where the bound must hold; the distortion is smaller below it [Hz].
    bound : float
        Largest relative loss of amplitude, for example 0.01.
    sampling_frequency : float
        [Hz]
    order : int, optional
        Order of one pass.

    Returns
    -------
    float
        Cut-off [Hz].

    Raises
    ------
    ModelError
        If the central differences alone exceed the bound.

    Examples
    --------
    >>> f_c = least_cutoff(20.0, bound=0.01, sampling_frequency=5e3)
    >>> round(f_c, 2), round(amplitude_distortion(20.0, f_c, 5e3).acceleration, 12)
    (35.61, -0.01)
    """
    difference = float(np.sinc(2 * frequency / sampling_frequency)) ** 2
    wanted = (1 - bound) / difference
    if not 0 < frequency < sampling_frequency / 4 or wanted >= 1:
        raise ModelError(
            f"distortion bound {100 * bound:g} %: two central differences at "
            f"{sampling_frequency:g} Hz already lose {100 * (1 - difference):.2g} % of an "
            f"acceleration at {frequency:g} Hz; sample faster, lower the frequency, or allow "
            f"a bound above {100 * (1 - difference):.2g} %"
        )
    warped = np.tan(np.pi * frequency / sampling_frequency)
    warped *= (wanted / (1 - wanted)) ** (1 / (2 * order))
    return float(np.arctan(warped) * sampling_frequency / np.pi)


@cache
def noise_gains(
    cutoff: float,
    sampling_frequency: float,
    order: int = 4,
    difference: Difference = central_difference,
) -> tuple[float, float, float]:
    """Return what one unit of white measurement noise becomes after filter and differences.

    Parameters
    ----------
    cutoff, sampling_frequency : float
        [Hz].
    order : int, optional
        Order of one pass.
    difference : callable, optional
        ``difference(values, dt)`` differentiates values (N,); by default `central_difference`.

    Returns
    -------
    tuple of float
        Standard deviation of the filtered signal [1], of its first [1/s] and of its second
        difference [1/s²], per standard deviation of the raw samples.

    Examples
    --------
    >>> [float(f"{gain:.2g}") for gain in noise_gains(35.0, 5e3)]
    [0.11, 13.0, 2300.0]
    """
    _check_cutoff(cutoff, sampling_frequency)
    f = (np.arange(20_000) + 0.5) / 20_000 * sampling_frequency / 2
    ratio = np.tan(np.pi * f / sampling_frequency) / np.tan(np.pi * cutoff / sampling_frequency)
    lowpass = 1 / (1 + ratio ** (2 * order))
    impulse = np.zeros(4 * len(_STENCIL) + 1)
    impulse[2 * len(_STENCIL)] = 1.0
    taps = difference(impulse, 1 / sampling_frequency)[: 2 * len(_STENCIL)]
    turns = 2 * np.pi * f / sampling_frequency
    slope = sum(2 * tap * np.sin(k * turns) for k, tap in enumerate(taps[::-1].tolist(), 1) if tap)
    x, v, a = (float(np.sqrt(np.mean((lowpass * slope**k) ** 2))) for k in range(3))
    return x, v, a


def _check_cutoff(cutoff: float, sampling_frequency: float) -> None:
    if not 0 < cutoff < sampling_frequency / 2:
        raise ModelError(
            f"cut-off {cutoff:g} Hz must lie between 0 and half the sampling frequency of "
            f"{sampling_frequency:g} Hz"
        )
