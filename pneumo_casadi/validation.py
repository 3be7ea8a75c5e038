"""Validation: how far simulation and measurement disagree on held-out data."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pneumo_casadi.data import Recording
from pneumo_casadi.data.recording.curves import MEASURED, Curves
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.output_error.initial_states import estimate_initial_states
from pneumo_casadi.estimation.output_error.shooting.segments import measured_states
from pneumo_casadi.metrics import gap, output_noise, signal_std
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.integration import held_inputs, sample_lengths
from pneumo_casadi.model.sampled_axis import SampledAxis, added_inputs
from pneumo_casadi.model.simulation import (
    Trajectory,
    compute_outputs,
    simulate,
    simulate_closed_loop,
    simulate_windows,
    stepping_for,
)
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.presentation import Presentable
from pneumo_casadi.runtime.progress import Progress, no_progress

#: Length of the beginning of a record from which the initial state of a free run is estimated [s].
START = 2.0
#: Samples of a record with which a trajectory is compared.
Rows = slice | NDArray[np.int64]
_WHOLE = slice(None)


@dataclass(frozen=True, slots=True)
class Error:
    """Size of a difference between simulation and measurement.

    Parameters
    ----------
    unit : str
        Unit of `rms`.
    rms : float
        Root mean square of measured minus simulated samples, measurement noise included.
    percent : float
        The same in per cent of the signal's standard deviation.
    noise_percent : float
        What a perfect model would leave: the sensor's noise, in per cent of the same.
    """

    unit: str
    rms: float
    percent: float
    noise_percent: float

    @property
    def noise(self) -> float:
        """Standard deviation of one sample of the sensor, in `unit`; 0 where it is unknown."""
        return self.rms * self.noise_percent / self.percent if self.percent else 0.0

    @property
    def gap_percent(self) -> float:
        """Error above the noise floor in per cent of the signal; see `pneumo_casadi.metrics`."""
        return float(gap(self.percent**2, self.noise_percent))


@dataclass(frozen=True, eq=False)
class Run:
    """A validation record and its simulations."""

    record: Recording
    open_loop: Trajectory
    closed_loop: Trajectory | None


@dataclass(frozen=True, eq=False, repr=False)
class Validation(Presentable):
    """Errors of an axis on held-out records.

    Parameters
    ----------
    open_loop : dict of str to Error
        Inputs as measured over the whole record, initial state estimated from the first 2 s; by
        output.
    closed_loop : dict of str to Error, or None
        Under the recorded controller, from the measured initial state, inputs included, with a
        recorded disturbance ``F_pulse`` added to what the controller sets; None where
        the bench names no controller or the records no reference.
    windows : dict of float to dict of str to Error
        Open loop over windows of so many seconds, each with an estimated initial state.
    runs : tuple of Run
        The trajectories.
    """

    open_loop: Mapping[str, Error]
    closed_loop: Mapping[str, Error] | None
    windows: Mapping[float, Mapping[str, Error]]
    runs: tuple[Run, ...]

    @property
    def curves(self) -> tuple[Curves, ...]:
        """Outputs of the held-out records over time, measured and simulated."""
        return tuple(self._curves(run) for run in self.runs)

    def _curves(self, run: Run) -> Curves:
        simulated = {"open loop": run.open_loop}
        if run.closed_loop is not None:
            simulated["closed loop"] = run.closed_loop
        return Curves(
            run.record.name,
            run.record.t,
            {name: error.unit for name, error in self.open_loop.items()},
            {name: error.noise for name, error in self.open_loop.items()},
            {
                name: {MEASURED: run.record[name]}
                | {label: trajectory[name] for label, trajectory in simulated.items()}
                for name in self.open_loop
            },
        )

    @property
    def headline(self) -> str:
        """Held-out records."""
        names = ", ".join(run.record.name for run in self.runs)
        return f"Validation on {len(self.runs)} held-out records ({names})"

    def to_frame(self) -> pd.DataFrame:
        """Return one row an output and simulation: rms [SI], per cent of signal, sensor noise."""
        views: dict[str, Mapping[str, Error]] = {
            f"windows of {length:g} s": errors for length, errors in self.windows.items()
        }
        views["open loop"] = self.open_loop
        if self.closed_loop is not None:
            views["closed loop"] = self.closed_loop
        rows = [
            (view, name, error.rms, error.percent, error.noise_percent, error.unit)
            for view, errors in views.items()
            for name, error in errors.items()
        ]
        columns = ["simulation", "output", "rms", "percent", "noise_percent", "unit"]
        return pd.DataFrame(rows, columns=columns).set_index(["simulation", "output"])


def validate(
    axis: Axis,
    records: Sequence[Recording],
    windows: Sequence[float] = (0.1, 0.5, 2.0),
    progress: Progress | None = None,
) -> Validation:
    """Compare simulations of an axis with records.

    Parameters
    ----------
    axis : Axis
        With estimated parameters; none of them is changed here.
    records : sequence of Recording
        Records that were not used in the fit, for an honest figure.
    windows : sequence of float
        Lengths of the windows [s]; those longer than a record are left out.
    progress : callable, optional
        Called as ``progress(text, share)``.

    Returns
    -------
    Validation
        Errors are measured at every sample; samples after the last whole window are left out.

    Raises
    ------
    ModelError
        If there is no record, or a simulation leaves the finite numbers.
    FitError
        If the initial states cannot be estimated.

    Examples
    --------
    With ``result = pc.identify(pc.example_case())``:

    >>> held_out = result.case.validate[0].window(8.0, 9.0)
    >>> validation = pc.validate(result.axis, [held_out], windows=(0.5,))
    >>> validation.open_loop["x"].unit, validation.open_loop["x"].rms < 1e-3
    ('m', True)
    """
    if not records:
        raise ModelError("validation: no record; a fit is not validated on its own data")
    report = progress or no_progress
    runs = []
    for i, record in enumerate(records):
        report(f"free run of {record.name}", i / (len(records) + 1))
        runs.append(_run(axis, record))
    # A window ends on a sample that must still be in the record.
    lengths = [w for w in windows if all(round(w / record.dt) < record.N for record in records)]
    errors = {}
    for i, window in enumerate(lengths):
        report(f"windows of {window:g} s", (len(records) + i / len(lengths)) / (len(records) + 1))
        errors[window] = window_errors(axis, records, window)
    report("done", 1.0)
    open_loop = [(run.record, _WHOLE, run.open_loop) for run in runs]
    closed = [(run.record, run.closed_loop) for run in runs if run.closed_loop is not None]
    return Validation(
        _errors(axis, axis.outputs, open_loop),
        _loop_errors(axis, closed) if closed else None,
        errors,
        tuple(runs),
    )


def free_run(axis: Axis, record: Recording) -> Trajectory:
    """Simulate a record's inputs in open loop, initial state estimated from its first 2 s."""
    start = _estimated_start(axis, record)
    u, lengths = record.stack(axis.inputs), sample_lengths(record, record.dt)
    return simulate(axis, u, record.dt, start, record.hold, lengths)


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
    return simulate_closed_loop(
        axis,
        record["x_ref"],
        record.dt,
        x_0,
        disturbance=added_inputs(axis, record).T,
        memory=model.memory_at_start(x_0, record),
        lengths=sample_lengths(record, record.dt),
    )


def loop_errors(
    axis: Axis, records: Sequence[Recording], estimated: bool = False
) -> dict[str, Error]:
    """Compare records with simulations of their references under the bench's controller.

    Unlike `validate` it needs no free run, which a leak in one chamber drives into the end of the
    stroke, and out of the finite numbers. `estimated` as in `loop_run`.
    """
    return _loop_errors(axis, [(record, loop_run(axis, record, estimated)) for record in records])


def _loop_errors(axis: Axis, runs: Sequence[tuple[Recording, Trajectory]]) -> dict[str, Error]:
    pairs = [(record, _WHOLE, run) for record, run in runs]
    return _errors(axis, (*axis.outputs, *axis.kind.commands), pairs)


def _run(axis: Axis, record: Recording) -> Run:
    closes = axis.bench.controller.closes_loop and "x_ref" in record
    return Run(record, free_run(axis, record), loop_run(axis, record) if closes else None)


def window_errors(axis: Axis, records: Sequence[Recording], window: float) -> dict[str, Error]:
    """Simulate whole windows [s] of all records in open loop from their estimated states."""
    return errors_of_runs(axis, window_runs(axis, records, window))


def errors_of_runs(
    axis: Axis, runs: Sequence[tuple[Recording, Rows, Trajectory]]
) -> dict[str, Error]:
    """Return the errors of simulations, as `window_runs` returns them, by output."""
    return _errors(axis, axis.outputs, runs)


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
    units = {output: axis.unit(output) for output in axis.outputs}
    noise = {output: output_noise(axis, records, output) for output in axis.outputs}
    curves = []
    for record, several in zip(records, zip(*runs.values(), strict=True), strict=True):
        # Windows in which one model cannot start are left out for all.
        common = np.arange(record.N)
        for _, rows, _ in several:
            common = np.intersect1d(common, np.arange(record.N)[rows])
        values = {output: {MEASURED: record[output][common]} for output in axis.outputs}
        for name, (_, rows, run) in zip(runs, several, strict=True):
            for output in axis.outputs:
                values[output][name] = run[output][np.isin(np.arange(record.N)[rows], common)]
        curves.append(Curves(record.name, record.t[common], units, noise, values))
    return tuple(curves)


def window_runs(
    axis: Axis, records: Sequence[Recording], window: float
) -> list[tuple[Recording, Rows, Trajectory]]:
    """Return records, samples and simulations of their whole windows [s], one after another."""
    pairs: list[tuple[Recording, Rows, Trajectory]] = []
    for record in records:
        L = round(window / record.dt)
        states = estimate_initial_states(axis, record, window)
        starts = [(first, x_0) for first, x_0 in states if first + L < record.N]
        lengths = sample_lengths(record, record.dt)
        w = held_inputs(record.stack(axis.inputs), record.hold, lengths)
        stretches = np.stack([w[:, first : first + L] for first, _ in starts])
        x_0 = np.stack([x for _, x in starts], axis=1)
        stepping = stepping_for(axis, record.dt, record.hold, lengths)
        x = simulate_windows(axis, stepping, stretches, x_0)[:, :, :L]
        joined = np.hstack(list(x))
        u = np.hstack(list(stretches))[: len(axis.inputs)]
        rows = np.concatenate([np.arange(first, first + L) for first, _ in starts])
        y = compute_outputs(axis, joined, u)
        names = (axis.states, joined, axis.outputs, y, axis.inputs, u)
        pairs.append((record, rows, Trajectory(record["t"][rows], *names)))
    return pairs


def _errors(
    axis: Axis,
    channels: Sequence[str],
    pairs: Sequence[tuple[Recording, Rows, Trajectory]],
) -> dict[str, Error]:
    errors = {}
    records = [record for record, _, _ in pairs]
    for channel in channels:
        e = np.concatenate([record[channel][rows] - run[channel] for record, rows, run in pairs])
        std = signal_std(records, channel)
        rms = float(np.sqrt(np.mean(e**2)))
        noise = 0.0
        if channel in axis.outputs:
            noise = output_noise(axis, records, channel)
        share = 100 / std if std > 0 else np.inf
        errors[channel] = Error(axis.unit(channel), rms, rms * share, noise * share)
    return errors
