"""Validation: how far simulation and measurement disagree on held-out data."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from pneumo_casadi.data import Recording
from pneumo_casadi.data.record_ranges import record_ranges
from pneumo_casadi.data.recording.curves import MEASURED, Curves
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.simulation import Trajectory
from pneumo_casadi.runtime.presentation import Brief, Presentable
from pneumo_casadi.runtime.progress import Progress, no_progress
from pneumo_casadi.runtime.provenance import provenance
from pneumo_casadi.validation.errors import (
    WHOLE,
    Error,
    errors_of_loops,
    errors_of_runs,
    window_errors,
)
from pneumo_casadi.validation.simulations import free_run, loop_run


@dataclass(frozen=True, eq=False, repr=False)
class Run(Brief):
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
    provenance : mapping, optional
        What is needed to repeat it: date, versions, records, and from the command line the files.
    """

    open_loop: Mapping[str, Error]
    closed_loop: Mapping[str, Error] | None
    windows: Mapping[float, Mapping[str, Error]]
    runs: tuple[Run, ...]
    provenance: Mapping[str, Any] = field(default_factory=dict)

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
    records: Recording | Sequence[Recording],
    windows: Sequence[float] = (0.1, 0.5, 2.0),
    progress: Progress | None = None,
) -> Validation:
    """Compare simulations of an axis with records.

    Parameters
    ----------
    axis : Axis
        With estimated parameters; none of them is changed here.
    records : Recording or sequence of Recording
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
    records = (records,) if isinstance(records, Recording) else tuple(records)
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
    open_loop = [(run.record, WHOLE, run.open_loop) for run in runs]
    closed = [(run.record, run.closed_loop) for run in runs if run.closed_loop is not None]
    return Validation(
        errors_of_runs(axis, open_loop),
        errors_of_loops(axis, closed) if closed else None,
        errors,
        tuple(runs),
        provenance([], {"windows": lengths}, records=record_ranges({"held out": records})),
    )


def _run(axis: Axis, record: Recording) -> Run:
    closes = axis.bench.controller.closes_loop and "x_ref" in record
    return Run(record, free_run(axis, record), loop_run(axis, record) if closes else None)
