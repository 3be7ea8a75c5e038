"""Clocks of records before filters: one frequency, and uniform where they were as recorded."""

from collections.abc import Iterable

import numpy as np
from scipy.interpolate import CubicSpline

from pneumo_casadi.data import Clock, InputHold, Recording
from pneumo_casadi.data.bench.axis_kind import FORCE_DRIVEN, PNEUMATIC
from pneumo_casadi.data.recording.clock import same_clock
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray

#: What a controller holds, and what is added to it.
COMMANDS = (*PNEUMATIC.commands, *FORCE_DRIVEN.commands, "F_pulse")


def require_one_frequency(recordings: Iterable[Recording]) -> None:
    """Refuse records of several sampling frequencies: one filter is for all that are fitted.

    Those whose clock is taken as recorded are resampled to one anyway.

    Raises
    ------
    CaseError
        Naming two files with their frequencies [Hz], and the remedy.
    """
    sampled = [record for record in recordings if record.clock is not Clock.AS_RECORDED]
    by_interval = sorted(sampled, key=lambda record: record.dt)
    if sampled and not same_clock(by_interval[-1].dt, by_interval[0].dt):
        fast, slow = by_interval[0], by_interval[-1]
        raise CaseError(
            f"{fast.source}: sampled at {1 / fast.dt:.6g} Hz, but {slow.source} at "
            f"{1 / slow.dt:.6g} Hz; records that are fitted need one sampling frequency: decimate "
            "the faster one (`Recording.decimate`), or leave one of them to validate"
        )


def on_uniform_clock(recording: Recording, dt: float | None = None) -> Recording:
    """Return a record on a uniform clock; itself where it is on one already.

    Measured signals are interpolated by cubic splines, whose error within the band of the
    filters, far below the sampling rate, is negligible beside the noise. A held input becomes its
    mean over each new step, so that it carries the same integral.

    Parameters
    ----------
    recording : Recording
        With any clock.
    dt : float, optional
        Step of the new clock [s]; by default the median step of the record.

    Returns
    -------
    Recording
        With a uniform clock.

    Examples
    --------
    >>> stamps = np.array([0.0, 1.0, 2.1, 3.0, 4.0])
    >>> ramp = Recording(stamps, {"x": 2 * stamps, "u_P": [1, 1, 0, 0, 0]}, "a", "memory",
    ...                  InputHold.ZERO, clock=Clock.AS_RECORDED)
    >>> uniform = on_uniform_clock(ramp)
    >>> uniform["x"].round(6), uniform["u_P"].round(6)
    (array([0., 2., 4., 6., 8.]), array([1. , 1. , 0.1, 0. , 0. ]))
    """
    if recording.clock is not Clock.AS_RECORDED:
        return recording
    step = recording.dt if dt is None else dt
    rows = int((recording.t[-1] - recording.t[0]) / step * (1 + 1e-9)) + 1
    t = recording.t[0] + step * np.arange(rows)
    held = recording.hold is InputHold.ZERO
    channels = {
        name: _means(recording.t, recording[name], t)
        if held and name in COMMANDS
        else CubicSpline(recording.t, recording[name])(t)
        for name in recording.names
    }
    return Recording(
        t, channels, recording.name, recording.source, recording.hold, recording.first_line
    )


def _means(stamps: FloatArray, u: FloatArray, t: FloatArray) -> FloatArray:
    """Return the means over the steps of `t` of an input held from each stamp to the next."""
    integral = np.concatenate([[0.0], np.cumsum(u[:-1] * np.diff(stamps))])
    edges = np.interp(t, stamps, integral)
    last = u[np.searchsorted(stamps, t[-1], side="right") - 1]
    return np.append(np.diff(edges) / np.diff(t), last)
