"""Records simulated by an axis: whole, under their controller, or in windows."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.data import Recording
from pneumo_casadi.data.recording.curves import MEASURED, Curves
from pneumo_casadi.estimation.output_error.initial_states import estimate_initial_states
from pneumo_casadi.estimation.output_error.shooting.segments import measured_states
from pneumo_casadi.metrics import output_noise
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.integration import held_inputs, sample_lengths
from pneumo_casadi.model.sampled_axis import SampledAxis, added_inputs
from pneumo_casadi.model.simulation import (
    Trajectory,
    compute_outputs,
    run_closed_loop,
    run_open_loop,
    simulate_windows,
)
from pneumo_casadi.model.stepping import ACCURATE, stepping_for
from pneumo_casadi.parameters import FloatArray

#: Length of the beginning of a record from which the initial state of a free run is estimated [s].
START = 2.0
#: Samples of a record with which a trajectory is compared; of windows (windows, samples of each).
Rows = slice | NDArray[np.int64]


def free_run(axis: Axis, record: Recording) -> Trajectory:
    """Simulate a record's inputs in open loop, initial state estimated from its first 2 s."""
    start = _estimated_start(axis, record)
    u, lengths = record.stack(axis.inputs), sample_lengths(record, record.dt)
    return run_open_loop(axis, u, record.dt, start, record.hold, lengths)


def _estimated_start(axis: Axis, record: Recording) -> FloatArray:
    # Estimated from the beginning only, so that everything after it is a prediction.
    start = record.window(record.t[0], record.t[0] + min(START, record.duration))
    ((_, x_0),) = estimate_initial_states(axis, start)
    return x_0


def loop_run(axis: Axis, record: Recording, estimated: bool = False) -> Trajectory:
    """Simulate a record's reference under the bench's controller.

    It begins at the measured state, with the states of effects at rest; or, where these matter (a
    play, a reservoir), at the state that `free_run` estimates from the first 2 s.
    """
    if estimated:
        x_0 = _estimated_start(axis, record)
    else:
        x_0 = measured_states(axis, record, axis.parameters)[:, 0]
    model = SampledAxis(axis, stepping_for(axis, record.dt), axis.bench.controller)
    return run_closed_loop(
        axis,
        record["x_ref"],
        record.dt,
        x_0,
        disturbance=added_inputs(axis, record).T,
        memory=model.memory_at_start(x_0, record),
        lengths=sample_lengths(record, record.dt),
    )


def window_runs(
    axis: Axis,
    records: Sequence[Recording],
    window: float,
    longest_step: float = ACCURATE,
    apart: float | None = None,
) -> list[tuple[Recording, Rows, Trajectory]]:
    """Return records, samples and simulations of their whole windows [s], one after another.

    Windows begin at whole blocks of samples, and end where the next one begins at the latest: they
    may be some samples shorter than `window`. The trajectory holds them one after another.

    `longest_step` is the length of a Runge-Kutta step times the fastest rate, see `substeps_for`.
    `apart` is the time from the beginning of a window to that of the next [s]; by default windows
    follow each other.
    """
    pairs: list[tuple[Recording, Rows, Trajectory]] = []
    for record in records:
        states = estimate_initial_states(axis, record, window, longest_step, apart)
        distances = np.diff([first for first, _ in states])
        L = int(min([round(window / record.dt), *distances]))
        starts = [(first, x_0) for first, x_0 in states if first + L < record.N]
        lengths = sample_lengths(record, record.dt)
        inputs = record.stack(axis.inputs)
        w = held_inputs(axis, inputs, record.hold, lengths)
        stretches = np.stack([w[:, first : first + L] for first, _ in starts])
        x_0 = np.stack([x for _, x in starts], axis=1)
        stepping = stepping_for(axis, record.dt, record.hold, lengths, longest_step)
        x = simulate_windows(axis, stepping, stretches, x_0)[:, :, :L]
        joined = np.hstack(list(x))
        rows = np.array([np.arange(first, first + L) for first, _ in starts])
        u = inputs[rows.ravel()].T
        y = compute_outputs(axis, joined, u)
        names = (axis.states, joined, axis.outputs, y, axis.inputs, u)
        pairs.append((record, rows, Trajectory(record["t"][rows].ravel(), *names)))
    return pairs


def window_curves(
    axis: Axis, runs: Mapping[str, Sequence[tuple[Recording, Rows, Trajectory]]]
) -> tuple[Curves, ...]:
    """Return outputs over time as several models simulate them over windows of the same records.

    Parameters
    ----------
    axis : Axis
        Gives outputs, units and the noise of the sensors.
    runs : mapping of str to sequence
        What `window_runs` returns, by the name of the simulation.
    """
    if not runs:
        return ()
    records = [record for record, _, _ in next(iter(runs.values()))]
    simulated = [run.outputs for several in runs.values() for _, _, run in several]
    outputs = [name for name in axis.outputs if all(name in names for names in simulated)]
    units = {output: axis.unit(output) for output in outputs}
    noise = {output: output_noise(axis, records, output) for output in outputs}
    curves = []
    for record, several in zip(records, zip(*runs.values(), strict=True), strict=True):
        # Windows in which one model cannot start are left out for all.
        common = np.arange(record.N)
        for _, rows, _ in several:
            common = np.intersect1d(common, np.arange(record.N)[rows])
        values = {output: {MEASURED: record[output][common]} for output in outputs}
        for name, (_, rows, run) in zip(runs, several, strict=True):
            shared = np.isin(np.arange(record.N)[rows].ravel(), common)
            for output in outputs:
                values[output][name] = run[output][shared]
        curves.append(Curves(record.name, record.t[common], units, noise, values))
    return tuple(curves)
