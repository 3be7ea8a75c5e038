"""Records cut into segments of whole blocks: what the output-error problem is made from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its submodules are loaded at first use

from pneumo_casadi.data import Recording
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.sampled_axis import SampledAxis
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.runtime.presentation import Brief

#: Length of the polynomial smoother that starts the states [s].
SMOOTHING = 0.02


@dataclass(frozen=True, slots=True, repr=False)
class Segment(Brief):
    """A stretch of one record with a free initial state, cut into intervals of whole blocks.

    Parameters
    ----------
    record, first : int
        Index of the record and of the first sample used.
    n, per : int
        Samples a block, blocks an interval (the last interval may hold fewer).
    w : (nw, K n) array
        What every sample is given, as `SampledAxis.streams` pairs it.
    y : (ny, K) array
        Measured outputs, mean over each block of n samples.
    x : (nx, ceil(K / per)) array
        States where the intervals begin, from smoothed measurements: a start.
    """

    record: int
    first: int
    n: int
    per: int
    w: FloatArray
    y: FloatArray
    x: FloatArray

    @property
    def K(self) -> int:
        """Number of blocks."""
        return int(self.y.shape[1])

    @property
    def intervals(self) -> int:
        """Number of intervals, each with a node at its beginning."""
        return int(self.x.shape[1])


def measured_states(axis: Axis, record: Recording, parameters: Parameters) -> FloatArray:
    """Return states of shape (nx, N) from smoothed measurements, effects' states at rest.

    Position and velocity come from a local quadratic over `SMOOTHING` seconds, which has no
    edge transient: corrupted velocities in the first samples cost an optimiser dozens of
    iterations. What the sensors of the axis add is taken off, so that its outputs are those
    measured: from a pressure off by a sensor's bias, the initial state of an axis that sticks may
    not be found.
    """
    # A start only: for it a clock with jitter counts as uniform.
    length = max(5, 2 * round(SMOOTHING / record.dt / 2) + 1)
    if length > record.N:
        raise ModelError(
            f"record {record.name}: {record.N} samples are too few to estimate a velocity; "
            f"at least {length} are needed"
        )

    def smooth(channel: str, derivative: int = 0) -> FloatArray:
        values: FloatArray = scipy.signal.savgol_filter(
            record[channel], length, 2, deriv=derivative, delta=record.dt, mode="interp"
        )
        return values

    pressures = [smooth(name) for name in axis.motion_states if name not in ("x", "v")]
    states = np.vstack([*pressures, smooth("x"), smooth("x", 1)])
    if not axis.effects:
        return states
    u, par = record.stack(axis.inputs).T, parameters.values[:, None]
    at_rest, sensors = axis.rest.map(record.N), axis.output.map(record.N)
    full = np.asarray(at_rest(states, u, par), dtype=float)
    outputs = np.asarray(sensors(full, u, par), dtype=float)
    true = states.copy()
    for i, name in enumerate(axis.outputs):
        if name in axis.motion_states:
            row = axis.motion_states.index(name)
            true[row] += states[row] - outputs[i]
    return np.asarray(at_rest(true, u, par), dtype=float)


def cut_segments(
    model: SampledAxis,
    records: Sequence[Recording],
    n: int,
    window: float | None = None,
    interval: float = np.inf,
    effect_states: Sequence[FloatArray] = (),
    apart: float | None = None,
) -> tuple[Segment, ...]:
    """Cut records into segments of whole blocks, and these into intervals.

    Parameters
    ----------
    n : int
        Samples per block.
    window : float, optional
        Longest segment [s]; by default each record is one segment. Free initial states in
        every window make a badly misfitting model converge, at the price of slow effects.
    interval : float
        Longest distance of two shooting nodes [s].
    effect_states : sequence of (nz, N) array, optional
        By record, the states of effects to start from; by default these are at rest.
    apart : float, optional
        From the beginning of a segment to that of the next [s]; by default they follow each other.

    Returns
    -------
    tuple of Segment
        Samples beyond the last whole block of a record are left out (fewer than n + 1).
    """
    block = n * model.stepping.dt
    spans = [
        (i, *span) for i, r in enumerate(records) for span in _spans(r, n, block, window, apart)
    ]
    longest = max(K for _, _, K in spans)
    most = max(1, round(min(interval, longest * block) / block))
    per = -(-longest // -(-longest // most))  # intervals of equal length rather than a short rest
    streams = [model.streams(record) for record in records]
    outputs = [record.stack(model.axis.outputs).T for record in records]
    states = [
        model.with_controller_memory(
            measured_states(model.axis, record, model.axis.parameters), record
        )
        for record in records
    ]
    n_motion = len(model.axis.motion_states)
    for state, driven in zip(states, effect_states, strict=False):
        state[n_motion : n_motion + len(driven)] = driven
    segments = []
    for i, first, K in spans:
        samples = slice(first, first + K * n)
        mean = outputs[i][:, samples].reshape(-1, K, n).mean(axis=2)
        nodes = states[i][:, samples][:, :: per * n]
        segments.append(Segment(i, first, n, per, streams[i][:, samples], mean, nodes))
    return tuple(segments)


def _spans(
    record: Recording, n: int, block: float, window: float | None, apart: float | None
) -> list[tuple[int, int]]:
    """Return first sample and number of blocks of each segment of a record."""
    blocks = (record.N - 1) // n
    if blocks < 1:
        raise ModelError(f"record {record.name}: {record.N} samples do not fill one block of {n}")
    longest = blocks if window is None else max(1, round(window / block))
    step = longest if apart is None else max(longest, round(apart / block))
    return [(k * n, min(longest, blocks - k)) for k in range(0, blocks, step)]
