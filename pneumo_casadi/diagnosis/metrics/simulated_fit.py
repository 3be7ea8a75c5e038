"""One fit simulated along the held-out records: in windows, and under the controller."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.data import Recording
from pneumo_casadi.diagnosis.prepare.fitted_model import FAULTS, FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.errors import ModelError
from pneumo_casadi.metrics import signal_std
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.model.integration import sample_lengths
from pneumo_casadi.model.simulation import Trajectory
from pneumo_casadi.model.stepping import COARSE, stepping_for
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.threads import one_thread
from pneumo_casadi.validation.errors import loop_errors
from pneumo_casadi.validation.simulations import Rows, window_runs

#: Length of the open-loop windows [s].
WINDOW = 0.5
#: From the beginning of a shorter window to that of the next [s]: about as many, in less time, and
#: by the golden ratio at another phase of any period of the reference.
APART = 0.618
#: Width of the smoothed sign of the velocity in simulations [m/s].
V_S_SIMULATED = 3e-4
#: Shortest step of a simulation that is waited for [s]. Models of the catalogue take 10 µs and
#: more; a term over pressures with the sign of the velocity asked for 0.7 µs, four minutes in which
#: its error grew to a hundred times the signal.
SHORTEST_STEP = 2e-6


@dataclass(frozen=True, eq=False)
class Simulated:
    """A fit simulated over the windows of the held-out records, or why that cannot be done.

    Parameters
    ----------
    windows : (windows, ny) array, or str
        Squared errors of every window, in per cent of the signals squared; or why there are none.
    runs : tuple
        Samples and trajectory of every record's windows.
    """

    windows: FloatArray | str
    runs: tuple[tuple[Rows, Trajectory], ...] = ()


def simulate_fit(
    study: Study, fitted: FittedModel, effects: Sequence[Effect], window: float = WINDOW
) -> Simulated:
    """Simulate a fit over the windows [s] of a study's held-out records.

    Those of `WINDOW` follow each other; shorter ones begin `APART` after each other.
    """
    apart = APART if window < WINDOW else None
    try:
        axis = _simulated_axis(study, fitted, effects)
        _require_steps(axis, study.held_out)
        runs = window_runs(axis, study.held_out, window, COARSE, apart)
    except FAULTS as error:
        return Simulated(str(error))
    squares = []
    for record, rows, run in runs:
        at = np.arange(record.N)[rows]  # (windows, samples of each)
        e = [record[name][at] - run[name].reshape(at.shape) for name in study.axis.outputs]
        squares.append(np.mean(np.square(e), axis=2).T)
    windows = np.asarray(np.concatenate(squares) / signal_stds(study) ** 2 * 1e4)
    return Simulated(windows, tuple((rows, run) for _, rows, run in runs))


def _simulated_axis(study: Study, fitted: FittedModel, effects: Sequence[Effect]) -> Axis:
    axis = study.axis.with_effects(*effects).with_parameters(dict(fitted.values))
    return axis.with_parameters({"v_s": V_S_SIMULATED})


@one_thread
def simulate_loop(
    study: Study, fitted: FittedModel, effects: Sequence[Effect]
) -> dict[str, float] | str:
    """Return the gap of every output of a fit under the controller, or why there is none."""
    try:
        axis = _simulated_axis(study, fitted, effects)
        _require_steps(axis, study.held_out)
        errors = loop_errors(axis, study.held_out)
    except FAULTS as error:
        return str(error)
    return {name: errors[name].gap_percent for name in axis.outputs}


def _require_steps(axis: Axis, records: Sequence[Recording]) -> None:
    for record in records:
        lengths = sample_lengths(record, record.dt)
        stepping = stepping_for(axis, record.dt, record.hold, lengths, COARSE)
        step = record.dt / stepping.substeps
        if step < SHORTEST_STEP:
            raise ModelError(
                f"{record.name}: the model is so stiff that it would be simulated in steps of "
                f"{1e6 * step:.2g} µs; {1e6 * SHORTEST_STEP:g} µs is the least"
            )


def signal_stds(study: Study) -> FloatArray:
    """Return the standard deviations of the outputs of the held-out records, (ny,)."""
    return np.array([signal_std(study.held_out, name) for name in study.axis.outputs])
