"""Sensor noise where the axis rests: there it is seen at the frequencies of the motion themselves.

Noise that an amplifier or a filter shapes beside the white noise of the converter is hidden by that
above the motion. Underestimated by a factor of two, it made right models of four axes of another
program leave what no noise explains.
"""

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.signals.bandwidth import white_noise_std
from pneumo_casadi.signals.sensor_noise import (
    ALIASED,
    COLOURED,
    FITTED,
    NEAR,
    QUIET,
    WANTED,
    WINDOW,
    SensorNoise,
    estimate_sensor_noise,
    pole_distance,
    quiet,
    spectra,
    stands_out,
    whittle,
)

#: The axis rests in a window whose positions scatter by no more than this multiple of their noise.
AT_REST = 2.2
#: Relative difference of two clocks that are one.
ONE_CLOCK = 1e-2
#: Windows at rest from which on they tell the noise, and the lowest frequency that the pressures'
#: slow changes leave free there [Hz].
LEAST_AT_REST, ABOVE_CHANGES = 12, 12.0
#: Log-likelihood that coloured noise must gain over white noise there, as if all windows and
#: frequencies told of it independently. Of 800 channels with white noise it gained up to 9 where
#: they seemed coloured by a factor of two, and more on two axes, whose pressures changed at rest.
EVIDENCE = 10.0
#: Corner frequencies compared [Hz], and power in the band of the motion over that of white noise.
CORNERS, EXCESSES = np.geomspace(5.0, 300.0, 60), np.geomspace(0.1, 1e4, 60)


def sensor_noises(records: Sequence[Recording], channel: str) -> tuple[SensorNoise, ...]:
    """Return the noise of a sensor in every record.

    Parameters
    ----------
    records : sequence of Recording
        Of one axis: a sensor has the same noise in all that have one sampling frequency.
    channel : str
        What it measures.

    Returns
    -------
    tuple of SensorNoise
        As it is where the axis rests, if that shows surely that it is not white; else as each
        record shows it, see `estimate_sensor_noise`.

    Examples
    --------
    >>> from pneumo_casadi.data import InputHold
    >>> rng = np.random.default_rng(0)
    >>> t, noise = np.arange(8000) * 1e-3, SensorNoise(0.4, 0.92, 1e3, 0.9)
    >>> x = np.where(t > 4, np.sin(t - 4) ** 2, 0.0) + rng.normal(0.0, 1e-5, t.size)
    >>> channels = {"x": x, "p_P": 3e5 + 100 * noise.draw(t.size, rng)}
    >>> run = Recording(t, channels, "run", "simulated", InputHold.ZERO)
    >>> (at_rest,) = sensor_noises([run], "p_P")
    >>> 0.7 < at_rest.in_band / (100 * noise.in_band) < 1.4
    True
    >>> estimate_sensor_noise(run["p_P"], 1e3).in_band < 0.6 * at_rest.in_band
    True
    """
    rates = np.array([1 / record.dt for record in records])
    noises: dict[int, SensorNoise] = {}
    for rate in rates:
        alike = [
            k
            for k in np.flatnonzero(np.isclose(rates, rate, ONE_CLOCK)).tolist()
            if k not in noises
        ]
        at_rest = _shown_at_rest([records[k] for k in alike], channel, rate)
        for k in alike:
            noises[k] = at_rest or estimate_sensor_noise(records[k][channel], rates[k])
    return tuple(noises[k] for k in range(len(records)))


def _shown_at_rest(records: Sequence[Recording], channel: str, fs: float) -> SensorNoise | None:
    """Return coloured noise as the windows in which the axis rests show it; None without."""
    if not all("x" in record for record in records) or ALIASED * fs < NEAR[1]:
        return None
    records = [record for record in records if round(WINDOW * fs) <= record.N]
    if not records:
        return None
    parts = [_windows_at_rest(record[channel], record["x"], fs) for record in records]
    power = np.concatenate([power for _, power in parts], axis=1)
    if power.shape[1] < LEAST_AT_REST:
        return None
    noise = _most_likely(parts[0][0], power, fs)
    white = np.mean([white_noise_std(record[channel]) ** 2 for record in records])
    return noise if noise is not None and noise.in_band**2 >= COLOURED * white else None


def _windows_at_rest(
    values: FloatArray, position: FloatArray, fs: float
) -> tuple[FloatArray, FloatArray]:
    """Return frequencies (k,), and the power (k, windows) in the windows in which the axis rests.

    What the pressures do within a window is taken for a cubic.
    """
    n = round(WINDOW * fs)
    windows = sliding_window_view(position, n)[:: n - n // 2]
    # Noise of first order fitted to 300 Hz may miss white noise beside it.
    noise = max(white_noise_std(position), estimate_sensor_noise(position, fs).std)
    still = windows.std(axis=1) <= AT_REST * noise
    f, power = spectra(values, fs, _without_cubic)
    return f, power[:, still]


def _without_cubic(windows: FloatArray) -> FloatArray:
    """Return windows (..., n) without the cubic that fits each best."""
    n = windows.shape[-1]
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, n), 4))
    return np.asarray(windows - (windows @ basis) @ basis.T)


def _most_likely(f: FloatArray, power: FloatArray, fs: float) -> SensorNoise | None:
    """Return the noise of largest likelihood; None unless surely not white.

    The mains and other tones are left out, and frequencies at which a filter of higher order tells.
    """
    windows, power = power.shape[1], quiet(power)
    fitted = (f >= ABOVE_CHANGES) & (f <= FITTED[1]) & ~stands_out(power)
    f, power = f[fitted], power[fitted]
    if not power.size or power.min() <= 0:  # below the quantum
        return None
    correlations = np.exp(-2 * np.pi * CORNERS / fs)
    wanted = pole_distance(WANTED, correlations, fs) ** 2
    first_order = wanted[:, None] / pole_distance(f, correlations[:, None], fs) ** 2
    variance, misfit = whittle(power, 1 + EXCESSES[:, None] * first_order[:, None])
    i, j = np.unravel_index(int(np.argmin(misfit)), misfit.shape)
    # A quartile tells of a level what the mean of a quarter of the windows does.
    gain = (np.log(np.mean(power)) - misfit[i, j]) * f.size * QUIET * windows
    if gain < EVIDENCE:
        return None
    white = float(np.sqrt(variance[i, j]))
    innovation = white * float(np.sqrt(EXCESSES[j] * wanted[i]))
    return SensorNoise(innovation, float(correlations[i]), fs, white)
