"""The bandwidth of the recorded dynamics, to which the filters' cut-offs are tied (eq. 14)."""

import numpy as np
import scipy  # its submodules are loaded at first use
from numpy.typing import ArrayLike

from pneumo_casadi.errors import ModelError

#: Length of the segments of the averaged spectrum [s]; resolution is its inverse.
SEGMENT = 4.0
#: A spectral line counts when it stands this far above the noise of the position sensor.
ABOVE_NOISE = 3.0
#: So many lines of noise in a row end the spectrum of the motion.
QUIET = 8
#: An axis whose positions span less than this many standard deviations of noise is at rest.
REST = 20.0


def white_noise_std(values: ArrayLike) -> float:
    """Estimate the standard deviation of white noise on a slow signal.

    Third differences remove any parabola and turn white noise of variance σ² into 20 σ²; their
    median absolute value ignores the few samples at steps.

    Parameters
    ----------
    values : (N,) array
        Raw samples, N of at least 4.

    Returns
    -------
    float
        In the unit of the signal. For a signal whose noise is below its quantum it is an upper
        bound of the size of that quantum.

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(0.0, 2.0, 20_000)
    >>> round(white_noise_std(np.linspace(0, 1e3, 20_000) + noise), 1)
    2.0
    """
    third = np.diff(np.asarray(values, dtype=float), n=3)
    robust = float(np.median(np.abs(third))) / 0.6745
    # A finely quantised slow signal has zero as its median: fall back on the plain deviation.
    return float((robust or float(np.std(third))) / np.sqrt(20.0))


def power_bandwidth(x: ArrayLike, sampling_frequency: float, share: float = 0.99) -> float:
    """Estimate ω_dyn / 2π as the frequency below which the velocity has nearly all its power.

    The spectrum of the velocity is that of the differenced position, less the share of the
    position sensor's white noise (which the difference would turn into most of the power).

    Parameters
    ----------
    x : (N,) array
        Measured position [m].
    sampling_frequency : float
        [Hz]
    share : float, optional
        Share of the velocity's power below the bandwidth.

    Returns
    -------
    float
        [Hz], resolved to 1 / 4 s. It shows what the record excites, not what the loop could
        follow; give `f_dyn` yourself where you know the closed loop's bandwidth.

    Raises
    ------
    ModelError
        If the axis does not move more than the noise of its sensor.

    Examples
    --------
    >>> t = np.arange(20_000) / 1e3
    >>> power_bandwidth(0.1 * np.sin(2 * np.pi * 2.0 * t), 1e3)
    2.25
    """
    position = np.asarray(x, dtype=float)
    velocity = np.diff(position) * sampling_frequency
    segment = min(velocity.size, round(SEGMENT * sampling_frequency))
    f, power = scipy.signal.welch(velocity, sampling_frequency, nperseg=segment, detrend="constant")
    difference = 2 * sampling_frequency * np.sin(np.pi * f / sampling_frequency)
    sigma = white_noise_std(position)
    noise = sigma**2 * difference**2 * 2 / sampling_frequency
    motion = np.where(power > ABOVE_NOISE * noise, power - noise, 0.0)
    # Of thousands of lines some stand above the noise by chance, and the difference makes them
    # large: the motion ends where several lines in a row are nothing but noise.
    quiet = np.convolve(motion == 0.0, np.ones(QUIET), mode="valid") == QUIET
    quiet[: np.argmax(motion) + 1] = False
    motion[np.argmax(quiet) if quiet.any() else motion.size :] = 0.0
    if np.ptp(position) < REST * sigma or not np.any(motion > 0):
        raise ModelError(
            "no motion above the noise of the position sensor: give the bandwidth f_dyn yourself"
        )
    total = np.cumsum(motion)
    return float(f[np.searchsorted(total, share * total[-1])])
