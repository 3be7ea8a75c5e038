"""The level of sensor noise in the band of the motion, white or not.

White noise is told by the differences of raw samples. A sensor behind an analogue filter has noise
that is larger at the frequencies of the motion than between its samples: taken for white, it would
be underestimated many times, and a model that is right would seem to leave what no noise explains.
"""

import numpy as np
import scipy  # its submodules are loaded at first use
from numpy.typing import ArrayLike

from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.signals.bandwidth import white_noise_std

#: Length of a window [s], and how many there must be.
WINDOW, LEAST_WINDOWS = 0.2, 8
#: Bands above the motion in which noise is looked for, and where its level is wanted [Hz].
BANDS, WANTED = ((40.0, 90.0), (100.0, 200.0)), 15.0
#: Share of the sampling frequency up to which a spectrum is free of the filter against aliasing.
ALIASED = 0.45
#: Share of the windows that count as quiet, and what the periodogram of noise is there over its
#: mean.
QUIET = 0.25
QUIET_OVER_MEAN = -float(np.log(1 - QUIET))
#: Level in the first band over that of white noise from which on noise is coloured, ...
COLOURED = 2.0
#: ... and by how much more at most it may be larger in the band of the motion.
MOST_EXTRAPOLATED = 10.0


def sensor_noise_std(values: ArrayLike, sampling_frequency: float) -> float:
    """Estimate sensor noise by the white noise that is as large in the band of the motion.

    Parameters
    ----------
    values : (N,) array
        Raw samples.
    sampling_frequency : float
        [Hz]

    Returns
    -------
    float
        Standard deviation of white noise, sampled as often, with the power spectral density that
        the sensor's noise has at 15 Hz, in the unit of the signal. That of `white_noise_std` where
        the noise is white within a factor of two, or the record too short or slow to tell.

    Notes
    -----
    Quiet quarters of all windows, and medians over frequencies, leave out steps, bursts and lines
    of the mains. Noise of first order has 1/S linear in 1 - cos ω: two bands tell S at 15 Hz.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> white = rng.normal(0.0, 1.0, 20_000)
    >>> round(sensor_noise_std(white, 1e3), 1)
    1.0
    >>> coloured = scipy.signal.lfilter([1.0], [1.0, -0.8], white)  # S(0) = 25
    >>> 3.5 < sensor_noise_std(coloured, 1e3) < 5.5
    True
    """
    samples = np.asarray(values, dtype=float)
    white = white_noise_std(samples)
    if white == 0:  # below the quantum
        return white
    levels = [_quiet_level(samples, sampling_frequency, band) for band in BANDS]
    relative = [level * sampling_frequency / (2 * white**2) for level in levels]
    if not relative[0] > COLOURED:  # nor where it is no number
        return white
    return white * float(np.sqrt(_in_band(relative, sampling_frequency)))


def _quiet_level(samples: FloatArray, fs: float, band: tuple[float, float]) -> float:
    """Return the power spectral density in a band while it is quiet; nan if it cannot be told."""
    n = round(WINDOW * fs)
    if band[1] > ALIASED * fs or samples.size < n * (LEAST_WINDOWS + 1) / 2:
        return float("nan")
    f, _, power = scipy.signal.spectrogram(
        samples, fs, window="hann", nperseg=n, noverlap=n // 2, detrend=scipy.signal.detrend
    )
    within = power[(f >= band[0]) & (f <= band[1])]
    return float(np.median(np.quantile(within, QUIET, axis=1))) / QUIET_OVER_MEAN


def _in_band(levels: list[float], fs: float) -> float:
    """Return the level in the band of the motion, of those in both bands above it."""
    near, far = levels
    if not far > 0:
        return near
    at = [1 - np.cos(2 * np.pi * f / fs) for f in (WANTED, *(sum(b) / 2 for b in BANDS))]
    inverse = 1 / near - (1 / far - 1 / near) * (at[1] - at[0]) / (at[2] - at[1])
    least = 1 / (MOST_EXTRAPOLATED * near)
    return float(1 / max(inverse, least))
