"""Sensors and commands that do not behave: dead, frozen, coarse, or against the control law."""

import numpy as np

from pneumo_casadi.data.bench.controllers import ProportionalController
from pneumo_casadi.data.bench.driven_bench import AnyBench
from pneumo_casadi.data.recording.channels import UNITS
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray

FROZEN_ROWS = 50  # noise of a quantum or more repeats a value this often with p < 1e-19
FROZEN_SHARE = 0.1
LAW_TOLERANCE = 0.1


def check_sensors(recording: Recording, bench: AnyBench) -> tuple[str, ...]:
    """Check that sensors live and commands follow the controller.

    Returns
    -------
    tuple of str
        Odd but possible: short frozen stretches, coarse quantisation, commands off the law.

    Raises
    ------
    CaseError
        If a channel is constant, a noisy sensor stands still for a tenth of the record, or
        positions and the control law differ by a factor of a thousand.
    """
    for channel in (*bench.kind.outputs, *bench.kind.commands):
        _check_alive(recording, channel)
    notes: list[str] = []
    if bench.noise is not None:
        for channel in bench.kind.outputs:
            notes += _check_frozen(recording, channel, bench.noise.of(channel))
    if isinstance(bench.controller, ProportionalController):
        notes += _check_law(recording, bench.controller)
    return tuple(notes)


def quantisation_step(values: FloatArray) -> float:
    """Return the smallest step between neighbouring samples, 0 for a constant.

    Examples
    --------
    >>> quantisation_step(np.array([0.0, 0.5, 0.5, 2.0]))
    0.5
    """
    differences = np.abs(np.diff(values))
    moved = differences[differences > 1e-12 * np.abs(values).max()]
    return float(moved.min()) if moved.size else 0.0


def longest_run(values: FloatArray) -> tuple[int, int]:
    """Return start and length of the longest stretch of equal samples.

    Examples
    --------
    >>> longest_run(np.array([1.0, 2.0, 2.0, 2.0, 3.0]))
    (1, 3)
    """
    starts = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1, [values.size]])
    lengths = np.diff(starts)
    k = int(lengths.argmax())
    return int(starts[k]), int(lengths[k])


def _check_alive(recording: Recording, channel: str) -> None:
    values = recording[channel]
    if np.ptp(values) == 0:
        raise CaseError(
            f"{recording.where(0)}: `{channel}` stays at {values[0]:g} {UNITS[channel]} in all "
            f"{values.size} rows: a dead sensor or no excitation; record again"
        )


def _check_frozen(recording: Recording, channel: str, sigma: float | None) -> list[str]:
    if sigma is None:
        return []
    values = recording[channel]
    step = quantisation_step(values)
    if step > sigma:
        return [
            f"{recording.source}: `{channel}` is quantised to {step:.3g} {UNITS[channel]}, more "
            f"than its noise of {sigma:.3g} {UNITS[channel]}"
        ]
    start, length = longest_run(values)
    if length < FROZEN_ROWS:
        return []
    message = (
        f"{recording.where(start)}: `{channel}` stays at {values[start]:g} {UNITS[channel]} for "
        f"{length} rows although its noise is {sigma:.3g} {UNITS[channel]}"
    )
    if length >= FROZEN_SHARE * values.size:
        raise CaseError(f"{message}: a frozen sensor; cut these rows out or record again")
    return [f"{message}; check the sensor"]


def _check_law(recording: Recording, controller: ProportionalController) -> list[str]:
    u_P, notes = recording["u_P"], []
    opposition = np.abs(u_P + recording["u_N"])
    k = int(opposition.argmax())
    if opposition[k] > LAW_TOLERANCE * np.abs(u_P).max():
        notes.append(
            f"{recording.where(k)}: `u_N` = {recording['u_N'][k]:g} V is not −`u_P` = "
            f"{-u_P[k]:g} V as the control law has it"
        )
    law = controller.gain * (recording["x_ref"] - recording["x"])
    inside = np.abs(u_P) < 0.98 * controller.u_max
    u, law = u_P[inside], law[inside]
    if not law.size or not law @ law:
        return notes
    slope = float(u @ law / (law @ law))
    if abs(1e3 * slope - 1) < LAW_TOLERANCE:
        raise CaseError(
            f"{recording.source}: `u_P` is {slope:.3g} times gain (x_ref − x), expected 1; are "
            "`x` and `x_ref` in mm?"
        )
    off = float(np.linalg.norm(u - law)) / max(float(np.linalg.norm(u)), 1e-300)
    if off > LAW_TOLERANCE:
        notes.append(
            f"{recording.source}: `u_P` differs from gain (x_ref − x) by {100 * off:.0f} % rms; "
            "closed-loop simulation will not follow the record"
        )
    return notes
