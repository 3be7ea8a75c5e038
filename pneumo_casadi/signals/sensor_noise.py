"""Sensor noise in the band of the motion, white or not.

White noise is told by the differences of raw samples. A sensor behind an analogue filter has noise
that is larger at the frequencies of the motion than between its samples: taken for white, it would
be underestimated many times, and a model that is right would seem to leave what no noise explains.
"""

from dataclasses import dataclass

import numpy as np
import scipy  # its submodules are loaded at first use
from numpy.typing import ArrayLike

from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.signals.bandwidth import white_noise_std

#: Length of a window [s], and how many there must be.
WINDOW, LEAST_WINDOWS = 0.2, 8
#: Band above the motion by which noise is told white or not, band in which that of first order is
#: fitted, and where its level is wanted [Hz].
NEAR, FITTED, WANTED = (40.0, 90.0), (50.0, 300.0), 15.0
#: Share of the sampling frequency up to which a spectrum is free of the filter against aliasing.
ALIASED = 0.45
#: Share of the windows that count as quiet, and what the periodogram of noise is there over its
#: mean.
QUIET = 0.25
QUIET_OVER_MEAN = -float(np.log(1 - QUIET))
#: Level above the motion over that of white noise from which on noise is coloured.
COLOURED = 2.0
#: Frequencies around one that tell its level, and the power over it from which on it is a line.
LINES, LINE = 21, 3.0
#: Corner frequencies compared: noise that a slower filter shapes is below the motion [Hz].
CORNERS = np.geomspace(15.0, 300.0, 100)


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """Noise of first order, e_k = correlation e_{k-1} + w_k with white w.

    Parameters
    ----------
    innovation : float
        Standard deviation of w, in the unit of the signal.
    correlation : float
        Of neighbouring samples, in [0, 1).
    sampling_frequency : float
        [Hz]
    """

    innovation: float
    correlation: float
    sampling_frequency: float

    @property
    def in_band(self) -> float:
        """Standard deviation of white noise that is as large in the band of the motion."""
        return self.at(WANTED)

    def at(self, frequency: float) -> float:
        """Return the standard deviation of white noise that is as large at a frequency [Hz]."""
        if self.correlation == 0:
            return self.innovation
        turn = np.exp(2j * np.pi * frequency / self.sampling_frequency)
        return self.innovation / float(np.abs(turn - self.correlation))

    def draw(self, N: int, rng: np.random.Generator) -> FloatArray:
        """Return N samples of such noise."""
        white = rng.normal(0.0, self.innovation, N)
        if self.correlation == 0:
            return white
        white[:1] /= np.sqrt(1 - self.correlation**2)  # as large from the first sample on
        coloured = scipy.signal.lfilter([1.0], [1.0, -self.correlation], white)
        return np.asarray(coloured)


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
        `SensorNoise.in_band` of `estimate_sensor_noise`, in the unit of the signal.

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
    return estimate_sensor_noise(values, sampling_frequency).in_band


def estimate_sensor_noise(values: ArrayLike, sampling_frequency: float) -> SensorNoise:
    """Estimate sensor noise of first order by its levels above the band of the motion.

    Parameters
    ----------
    values : (N,) array
        Raw samples.
    sampling_frequency : float
        [Hz]

    Returns
    -------
    SensorNoise
        White, with the level of `white_noise_std`, where the noise is white within a factor of two
        or the record too short or slow to tell.

    Notes
    -----
    Quiet quarters of all windows leave out steps and bursts; frequencies that stand out from those
    around are lines of the mains and left out too. The corner frequency is that of largest
    likelihood (Whittle 1953).

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> noise = estimate_sensor_noise(SensorNoise(1.0, 0.8, 1e3).draw(20_000, rng), 1e3)
    >>> abs(noise.correlation - 0.8) < 0.1
    True
    """
    samples = np.asarray(values, dtype=float)
    white = white_noise_std(samples)
    if white == 0:  # below the quantum
        return SensorNoise(0.0, 0.0, sampling_frequency)
    as_white = SensorNoise(white, 0.0, sampling_frequency)
    n = round(WINDOW * sampling_frequency)
    if ALIASED * sampling_frequency < NEAR[1] or samples.size < n * (LEAST_WINDOWS + 1) / 2:
        return as_white
    f, power = _quiet_spectrum(samples, sampling_frequency)
    if np.median(power[(f >= NEAR[0]) & (f <= NEAR[1])]) < COLOURED * white**2:
        return as_white
    level = scipy.ndimage.percentile_filter(power, 40, size=LINES)
    fitted = (f >= FITTED[0]) & (f <= FITTED[1]) & (power < LINE * level)
    return _first_order(f[fitted], power[fitted], sampling_frequency)


def _quiet_spectrum(samples: FloatArray, fs: float) -> tuple[FloatArray, FloatArray]:
    """Return frequencies and the power of quiet windows there; 1 is that of white unit noise.

    Frequencies that the filter against aliasing weakens are left out.
    """
    n = round(WINDOW * fs)
    f, _, power = scipy.signal.spectrogram(
        samples, fs, window="hann", nperseg=n, noverlap=n // 2, detrend=scipy.signal.detrend
    )
    seen = f <= ALIASED * fs
    return f[seen], np.quantile(power[seen], QUIET, axis=1) / QUIET_OVER_MEAN * fs / 2


def _first_order(f: FloatArray, power: FloatArray, fs: float) -> SensorNoise:
    """Return the noise of first order of largest likelihood for a periodogram."""
    correlations = np.exp(-2 * np.pi * CORNERS / fs)
    turns = np.exp(2j * np.pi * f / fs)
    shape = 1 / np.abs(turns - correlations[:, None]) ** 2
    variance = np.mean(power / shape, axis=1)
    best = int(np.argmin(np.log(variance) + np.mean(np.log(shape), axis=1)))
    return SensorNoise(float(np.sqrt(variance[best])), float(correlations[best]), fs)
