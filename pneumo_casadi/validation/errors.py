"""Sizes of the differences between simulations and records."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.data import Recording
from pneumo_casadi.metrics import gap, output_noise, signal_std
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.simulation import Trajectory
from pneumo_casadi.validation.simulations import Rows, loop_run, window_runs

#: All samples of a record.
WHOLE = slice(None)


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


def loop_errors(
    axis: Axis, records: Sequence[Recording], estimated: bool = False
) -> dict[str, Error]:
    """Compare records with simulations of their references under the bench's controller.

    Unlike `validate` it needs no free run, which a leak in one chamber drives into the end of the
    stroke, and out of the finite numbers. `estimated` as in `loop_run`.
    """
    return errors_of_loops(
        axis, [(record, loop_run(axis, record, estimated)) for record in records]
    )


def errors_of_loops(axis: Axis, runs: Sequence[tuple[Recording, Trajectory]]) -> dict[str, Error]:
    """Return the errors of closed-loop simulations, as `loop_run` returns them; inputs too."""
    pairs = [(record, WHOLE, run) for record, run in runs]
    return _errors(axis, (*axis.outputs, *axis.kind.commands), pairs)


def window_errors(axis: Axis, records: Sequence[Recording], window: float) -> dict[str, Error]:
    """Simulate whole windows [s] of all records in open loop from their estimated states."""
    return errors_of_runs(axis, window_runs(axis, records, window))


def errors_of_runs(
    axis: Axis, runs: Sequence[tuple[Recording, Rows, Trajectory]]
) -> dict[str, Error]:
    """Return the errors of simulations, as `window_runs` returns them, by output."""
    return _errors(axis, axis.outputs, runs)


def _errors(
    axis: Axis,
    channels: Sequence[str],
    pairs: Sequence[tuple[Recording, Rows, Trajectory]],
) -> dict[str, Error]:
    errors = {}
    records = [record for record, _, _ in pairs]
    for channel in channels:
        e = np.concatenate(
            [record[channel][rows].ravel() - run[channel] for record, rows, run in pairs]
        )
        std = signal_std(records, channel)
        rms = float(np.sqrt(np.mean(e**2)))
        noise = 0.0
        if channel in axis.outputs:
            noise = output_noise(axis, records, channel)
        share = 100 / std if std > 0 else np.inf
        errors[channel] = Error(axis.unit(channel), rms, rms * share, noise * share)
    return errors
