"""Records cut into segments of whole blocks: what the output-error problem is made from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from pneumo_casadi.axis import Axis
from pneumo_casadi.errors import ModelError
from pneumo_casadi.integration import held_inputs
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.recording import Recording

#: Length of the polynomial smoother that starts the states [s].
SMOOTHING = 0.02


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of one record with a free initial state.

    Parameters
    ----------
    record, first : int
        Index of the record and of the first sample used.
    n : int
        Samples per block.
    w : (nw, K n) array
        Inputs of every sample, as `held_inputs` pairs them.
    y : (ny, K) array
        Measured outputs, mean over each block of n samples.
    x : (nx, K + 1) array
        States at the ends of the blocks, from smoothed measurements: a start.
    """

    record: int
    first: int
    n: int
    w: FloatArray
    y: FloatArray
    x: FloatArray

    @property
    def K(self) -> int:
        """Number of blocks."""
        return int(self.y.shape[1])


def measured_states(axis: Axis, record: Recording, parameters: Parameters) -> FloatArray:
    """Return states of shape (nx, N) from smoothed measurements, effects' states at rest.

    Position and velocity come from a local quadratic over `SMOOTHING` seconds, which has no
    edge transient: corrupted velocities in the first samples cost an optimiser dozens of
    iterations.
    """
    length = max(5, 2 * round(SMOOTHING / record.dt / 2) + 1)
    if length > record.N:
        raise ModelError(
            f"record {record.name}: {record.N} samples are too few to estimate a velocity; "
            f"at least {length} are needed"
        )

    def smooth(channel: str, derivative: int = 0) -> FloatArray:
        found: FloatArray = savgol_filter(
            record[channel], length, 2, deriv=derivative, delta=record.dt, mode="interp"
        )
        return found

    motion = [smooth(name) for name in axis.outputs[:-1]]
    states = np.vstack([*motion, smooth("x"), smooth("x", 1)])
    if axis.states == axis.motion_states:
        return states
    u = record.stack(axis.inputs).T
    full = axis.rest.map(record.N)(states, u, parameters.values[:, None])
    return np.asarray(full, dtype=float)


def cut(
    axis: Axis,
    records: Sequence[Recording],
    parameters: Parameters,
    n: int,
    window: float | None = None,
) -> tuple[Segment, ...]:
    """Cut records into segments of whole blocks.

    Parameters
    ----------
    n : int
        Samples per block.
    window : float, optional
        Longest segment [s]; by default each record is one segment. Free initial states in
        every window make a badly misfitting model converge, at the price of slow effects.

    Returns
    -------
    tuple of Segment
        Samples beyond the last whole block of a record are left out (fewer than n + 1).
    """
    segments = []
    for index, record in enumerate(records):
        states = measured_states(axis, record, parameters)
        y = record.stack(axis.outputs).T
        w = held_inputs(record.stack(axis.inputs), record.hold)
        blocks = w.shape[1] // n
        if blocks < 1:
            raise ModelError(
                f"record {record.name}: {record.N} samples do not fill one block of {n}"
            )
        longest = blocks if window is None else max(1, round(window / (n * record.dt)))
        for start in range(0, blocks, longest):
            K = min(longest, blocks - start)
            span = slice(start * n, (start + K) * n)
            mean = y[:, span].reshape(y.shape[0], K, n).mean(axis=2)
            nodes = states[:, start * n : (start + K) * n + 1 : n]
            segments.append(Segment(index, start * n, n, w[:, span], mean, nodes))
    return tuple(segments)
