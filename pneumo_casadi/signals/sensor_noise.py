"""Sensor noise in the band of the motion, white or not.

White noise is told by the differences of raw samples. A sensor behind an analogue filter has noise
that is larger at the frequencies of the motion than between its samples: taken for white, it would
be underestimated many times, and a model that is right would seem to leave what no noise explains.
Here it is known by its levels above these frequencies; where the axis rests, see `noise_at_rest`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy  # its submodules are loaded at first use
from numpy.typing import ArrayLike, NDArray

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
    """Noise of first order, e_k = correlation e_{k-1} + w_k with white w, and white noise besides.

    Parameters
    ----------
    innovation : float
        Standard deviation of w, in the unit of the signal.
    correlation : float
        Of neighbouring e, in [0, 1).
    sampling_frequency : float
        [Hz]
    white : float, optional
        Standard deviation of the white noise besides.
    """

    innovation: float
    correlation: float
    sampling_frequency: float
    white: float = 0.0

    @property
    def std(self) -> float:
        """Standard deviation of one sample."""
        return float(np.hypot(self.innovation / np.sqrt(1 - self.correlation**2), self.white))

    @property
    def in_band(self) -> float:
        """Standard deviation of white noise that is as large in the band of the motion."""
        return self.at(WANTED)

    def at(self, frequency: float) -> float:
        """Return the standard deviation of white noise that is as large at a frequency [Hz]."""
        if self.correlation == 0:
            return float(np.hypot(self.innovation, self.white))
        distance = pole_distance(frequency, self.correlation, self.sampling_frequency)
        return float(np.hypot(self.innovation / distance, self.white))

    def draw(self, N: int, rng: np.random.Generator) -> FloatArray:
        """Return N samples of such noise."""
        noise = rng.normal(0.0, self.innovation, N)
        if self.correlation:
            noise[:1] /= np.sqrt(1 - self.correlation**2)  # as large from the first sample on
            noise = np.asarray(scipy.signal.lfilter([1.0], [1.0, -self.correlation], noise))
        return noise + rng.normal(0.0, self.white, N) if self.white else noise


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
    >>> 3.5 < noise.in_band < 5.5  # S(0) = 25
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
    f, windows = spectra(samples, sampling_frequency, scipy.signal.detrend)
    power = quiet(windows)
    if np.median(power[(f >= NEAR[0]) & (f <= NEAR[1])]) < COLOURED * white**2:
        return as_white
    fitted = (f >= FITTED[0]) & (f <= FITTED[1]) & ~stands_out(power)
    return _first_order(f[fitted], power[fitted], sampling_frequency)


def spectra(
    samples: FloatArray, fs: float, detrend: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return frequencies (k,), and the power of every window there (k, windows).

    A window begins halfway through the last. Frequencies that the filter against aliasing weakens
    are left out. White noise of unit variance has a mean power of 1.
    """
    n = round(WINDOW * fs)
    f, _, power = scipy.signal.spectrogram(
        samples, fs, window="hann", nperseg=n, noverlap=n // 2, detrend=detrend
    )
    seen = f <= ALIASED * fs
    return f[seen], power[seen] * fs / 2


def quiet(power: FloatArray) -> FloatArray:
    """Return the mean power (k,) of noise whose quiet windows are those of others (k, windows)."""
    return np.asarray(np.quantile(power, QUIET, axis=1) / QUIET_OVER_MEAN)


def stands_out(power: FloatArray) -> NDArray[np.bool_]:
    """Return which frequencies stand out from those around, as the mains do."""
    return np.asarray(power >= LINE * scipy.ndimage.percentile_filter(power, 40, size=LINES))


def _first_order(f: FloatArray, power: FloatArray, fs: float) -> SensorNoise:
    """Return the noise of first order of largest likelihood for a periodogram."""
    correlations = np.exp(-2 * np.pi * CORNERS / fs)
    variance, misfit = whittle(power, 1 / pole_distance(f, correlations[:, None], fs) ** 2)
    best = int(np.argmin(misfit))
    return SensorNoise(float(np.sqrt(variance[best])), float(correlations[best]), fs)


def pole_distance(f: ArrayLike, correlations: ArrayLike, fs: float) -> FloatArray:
    """Return the distance of frequencies on the unit circle from the poles of noise."""
    turns = np.exp(2j * np.pi * np.asarray(f) / fs)
    return np.asarray(np.abs(turns - np.asarray(correlations)))


def whittle(power: FloatArray, shapes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the factor of largest likelihood of every spectrum (..., k), and how it misfits.

    The misfit is −log L over k, less one, of a periodogram (k,); see Whittle (1953).
    """
    factors = np.mean(power / shapes, axis=-1)
    return factors, np.log(factors) + np.mean(np.log(shapes), axis=-1)
