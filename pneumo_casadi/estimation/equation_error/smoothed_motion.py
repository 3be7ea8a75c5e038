"""The measured motion, smoothed, along which the balances are evaluated.

With laboratory noise (some 100 Pa, some 10 µm) filtered measurements are the true states to
a fraction of a per cent in the band in which an axis moves. Every balance can be evaluated along
them on its own, without simulating the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from pneumo_casadi.data import Clock, InputHold, Recording
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.signals import FilterPlan, InputPairing, filter_recording
from pneumo_casadi.signals.bandwidth import white_noise_std
from pneumo_casadi.signals.filtered_recording import velocity_noise
from pneumo_casadi.signals.noise_at_rest import sensor_noises
from pneumo_casadi.signals.resampling import on_uniform_clock
from pneumo_casadi.signals.sensor_noise import SensorNoise
from pneumo_casadi.signals.zero_phase import smooth_difference, zero_phase_lowpass

#: Cut-off of the zero-phase filter on the measurements [Hz].
CUTOFF = 60.0
#: The same as an angular frequency [rad/s].
BANDWIDTH = 2 * np.pi * CUTOFF
#: Where most of the noise of the smoothed velocity lies [Hz].
FASTEST = 45.0
#: Rate of the rows that a fit sees [1/s], and how many of their distances a window is wide.
ROW_RATE, WIDTH = 62.5, 4
#: Rate to which faster records are thinned once they are smooth [Hz].
RATE = 1000.0
#: Records are cut to a multiple of so many samples: about the window of one row.
WHOLE = 64
#: Below this velocity, and below so many standard deviations of its noise, the axis may stick.
SLOW, NOISE_MULTIPLE = 2e-3, 4.0


@dataclass(frozen=True, eq=False)
class SmoothedMotion:
    """One record as smoothed states, derivatives and the inputs around each sample.

    Parameters
    ----------
    t : (N,) array
        Instants [s].
    x, dx : (nx, N) array
        Nominal states and their derivatives, in the axis' order [SI].
    u : (nu, N) array
        Inputs.
    u_before : (nu, n) array
        Inputs at the samples before, whose measurements the filters took.
    commands_kept : bool
        Whether every column holds single commands, which act over the whole sample: neither means
        of several, as of records that were thinned or resampled, nor signals that run on.
    weak : (m, N) sparse array
        Test functions: windows that average a balance over a few hundredths of a second.
    moving : (m,) array of bool
        Rows in whose window no sample was slow: Coulomb friction has a known sign there.
    dt : float
        Sampling period of what is kept [s].
    noise : (ny,) array
        Standard deviation of white noise at this sampling period with the power spectral density
        that the sensor noise has in the band of the motion [Pa, Pa, m].
    velocity_noise : float
        What it leaves on the smoothed velocity [m/s].
    name : str
        Of the record.
    """

    t: FloatArray
    x: FloatArray
    dx: FloatArray
    u: FloatArray
    u_before: FloatArray
    commands_kept: bool
    weak: Any
    moving: NDArray[np.bool_]
    dt: float
    noise: FloatArray
    velocity_noise: float
    name: str

    @property
    def N(self) -> int:
        """Number of samples."""
        return int(self.t.size)

    @property
    def m(self) -> int:
        """Number of rows."""
        return int(self.moving.size)

    @property
    def stride(self) -> int:
        """Samples from row to row."""
        return _stride(self.dt)

    @property
    def row_rate(self) -> float:
        """Rate of the rows [1/s]: `ROW_RATE`, as nearly as whole samples allow."""
        return 1 / (self.dt * self.stride)

    def used(self, axis: Axis) -> NDArray[np.bool_]:
        """Return which rows of each balance count, shape (ne, m): force only in motion."""
        rows = np.ones((len(axis.equations), self.m), dtype=bool)
        rows[axis.equations.index("force")] = self.moving
        return rows

    def averaged(self, rows: FloatArray) -> FloatArray:
        """Average a signal (N,), or rows of signals (n, N), over the windows: (m,) or (n, m)."""
        every, blocks = self.stride, self.m + WIDTH
        signals = np.atleast_2d(rows)[:, : blocks * every]
        if signals.shape[1] < blocks * every:
            signals = np.pad(signals, ((0, 0), (0, blocks * every - signals.shape[1])))
        # What every stretch between two rows gives to each window that reaches into it: one dense
        # product, several times as fast as the sparse one.
        parts = signals.reshape(-1, every) @ _window(every).reshape(-1, every).T
        by_signal = parts.reshape(len(signals), blocks, -1)
        means = np.sum([by_signal[:, k : k + self.m, k] for k in range(WIDTH + 1)], axis=0)
        return np.asarray(means[0] if rows.ndim == 1 else means)

    def smooth(self, values: FloatArray) -> FloatArray:
        """Pass values (N,) through the filter that the measurements went through."""
        return zero_phase_lowpass(values, smoothing_filter(self.dt).cutoff, 1 / self.dt, _ORDER)

    def derivative(self, values: FloatArray) -> FloatArray:
        """Differentiate values (N,) as the measurements were."""
        return smooth_difference(values, self.dt)


_ORDER = 4


@lru_cache(maxsize=8)
def smoothing_filter(dt: float) -> FilterPlan:
    """Return the filter that records with a sampling period [s] are smoothed with."""
    return FilterPlan(sampling_frequency=1 / dt, cutoff=min(CUTOFF, 0.4 / dt))


def smooth_motion(
    axis: Axis,
    record: Recording,
    velocity_noise: float | None = None,
    noise: Sequence[SensorNoise] | None = None,
) -> SmoothedMotion:
    """Smooth a record for an axis.

    Parameters
    ----------
    axis : Axis
        Tells which states and inputs are needed.
    record : Recording
        Raw measurements.
    velocity_noise : float, optional
        Standard deviation of the noise of the smoothed velocity, by which rows count as slow [m/s];
        by default that of white noise. With `coloured_velocity_noise` fewer rows are left by which
        friction at low speed is recognised, but none in which its sign is wrong.
    noise : sequence of SensorNoise, optional
        Of every output; by default as this record shows it.

    Returns
    -------
    SmoothedMotion

    Raises
    ------
    CaseError
        If the record is too short for the filters.
    """
    fs = 1 / record.dt
    plan = smoothing_filter(record.dt)
    uniform = on_uniform_clock(record, record.dt)
    filtered = filter_recording(uniform, plan, InputPairing.SAMPLE, smooth_difference)
    names = axis.motion_states
    x, dx = filtered.stack_states(names), filtered.stack_derivatives(names)
    (u,) = filtered.stack_inputs(axis.inputs)
    t = filtered.t[None]
    # A command held from its sample to the next belongs to the middle of that step.
    if record.hold is InputHold.ZERO:
        held = len(axis.kind.commands)
        u = np.vstack([u[:held, :-1], _midway(u[held:])])
        t, x, dx = t[:, :-1] + record.dt / 2, _midway(x), _midway(dx)
    # The signals are band-limited, so that means over 1 ms lose nothing; at 5 kHz the fit is five
    # times faster.
    thin = max(1, int(fs / RATE))
    dt = thin * record.dt
    t, x, dx, u = (_thinned(part, thin) for part in (t, x, dx, u))
    of_v = filtered.velocity_noise if velocity_noise is None else velocity_noise
    slow = np.abs(x[names.index("v")]) < max(SLOW, NOISE_MULTIPLE * of_v)
    noise = noise or [noises[0] for noises in _noises(axis, [record])]
    weak = row_windows(x.shape[1], _stride(dt))
    return SmoothedMotion(
        t[0],
        x,
        dx,
        u,
        np.array([uniform[name][: filtered.dropped[0]] for name in axis.inputs]),
        thin == 1 and record.clock is Clock.UNIFORM and record.hold is InputHold.ZERO,
        weak,
        (weak @ slow.astype(float)) == 0,
        dt,
        np.array([each.in_band for each in noise]) / thin**0.5,
        filtered.velocity_noise,
        record.name,
    )


def _midway(values: FloatArray) -> FloatArray:
    """Return rows (n, N) midway between their samples, (n, N - 1), by cubics through four.

    The mean of two would lose 0.3 % of an acceleration at 25 Hz, sampled at 1 kHz.
    """
    between = (values[:, 1:] + values[:, :-1]) / 2
    outer = (values[:, 3:] + values[:, :-3]) / 2
    between[:, 1:-1] += (between[:, 1:-1] - outer) / 8
    return np.asarray(between)


def _stride(dt: float) -> int:
    return max(1, round(1 / dt / ROW_RATE))


def _thinned(values: FloatArray, factor: int) -> FloatArray:
    """Return means over so many samples, cut to whole windows."""
    n = values.shape[1] // factor // WHOLE * WHOLE
    means = values[:, : n * factor].reshape(len(values), n, factor).mean(axis=2)
    return np.asfortranarray(means)


def _window(every: int) -> FloatArray:
    """Return a Hann window with sum one, zeros behind, over whole distances of the rows."""
    hann = np.hanning(WIDTH * every + 3)[1:-1]
    return np.pad(hann / hann.sum(), (0, every - 1))


def row_windows(N: int, every: int) -> Any:
    """Return the window of every row as rows of a matrix."""
    window = _window(every)[: WIDTH * every + 1]
    first = np.arange(0, N - window.size + 1, every)
    columns = first[:, None] + np.arange(window.size)
    rows = np.repeat(np.arange(first.size), window.size)
    return csr_array((np.tile(window, first.size), (rows, columns.ravel())), shape=(first.size, N))


def coloured_velocity_noise(record: Recording, noise: SensorNoise) -> float:
    """Return the standard deviation of the smoothed velocity's noise, white or not [m/s].

    From that of the position sensor. A measured velocity, whose noise is white as a rule, needs no
    such care.
    """
    plan, uniform = smoothing_filter(record.dt), on_uniform_clock(record, record.dt)
    white = velocity_noise(uniform, plan, smooth_difference)
    between_samples = white_noise_std(record["x"])
    if "v" in record or not noise.correlation or not between_samples:
        return white
    return white * noise.at(FASTEST) / between_samples


def smooth_motions(axis: Axis, records: Sequence[Recording]) -> tuple[SmoothedMotion, ...]:
    """Smooth several records for an axis.

    Parameters
    ----------
    axis : Axis
        Tells which states and inputs are needed.
    records : sequence of Recording
        Raw measurements; what one of them shows of the noise of a sensor holds for all.

    Returns
    -------
    tuple of SmoothedMotion
        In the order of the records.
    """
    noises = zip(*_noises(axis, records), strict=True)
    pairs = zip(records, noises, strict=True)
    return tuple(smooth_motion(axis, record, noise=noise) for record, noise in pairs)


def _noises(axis: Axis, records: Sequence[Recording]) -> list[tuple[SensorNoise, ...]]:
    """Return for every output the noise of its sensor in each record."""
    return [sensor_noises(records, name) for name in axis.outputs]
