"""Sensors and commands that do not behave: dead, frozen, clipped, coarse, or against the law."""

from collections.abc import Iterator

import numpy as np

from pneumo_casadi.data.bench.bench_sections import noise_content
from pneumo_casadi.data.bench.controllers import (
    NestedController,
    NoController,
    ProportionalController,
)
from pneumo_casadi.data.bench.driven_bench import AnyBench
from pneumo_casadi.data.bench.sensor_noise import SensorNoise
from pneumo_casadi.data.bench.valve_source import Arrangement
from pneumo_casadi.data.checks.finding import Finding, Grade
from pneumo_casadi.data.recording.channels import UNITS, column_name
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.data.recording.samples import longest_run, noise_of, quantisation_step
from pneumo_casadi.errors import CaseError

FROZEN_ROWS = 50  # noise of a quantum or more repeats a value this often with p < 1e-19
FROZEN_SHARE = 0.1
LAW_TOLERANCE = 0.1
NOISY = 0.3  # noise over quantum from which neighbours rarely agree: the noise of rounding itself
CLIPPED_ROWS = 5  # equal rows: noise of such size repeats the extreme value so often with p < 1e-4
FEWEST_CLIPPED = 2  # once may be a rest
CLIPPED_SHARE = 0.01  # of the rows, from which a fit follows the limit and not the axis
NOISE_RATIO = 2.0  # estimated over stated noise, either way: what a model leaves is held against it


def check_sensors(recording: Recording, bench: AnyBench) -> Iterator[Finding]:
    """Check that sensors live and commands follow the controller.

    Yields
    ------
    Finding
        Odd but possible: short frozen stretches, clipped channels, coarse quantisation, noise that
        is not the one stated, commands off the law.

    Raises
    ------
    CaseError
        If a channel is constant, a noisy sensor stands still for a tenth of the record, or
        positions and the control law differ by a factor of a thousand.
    """
    for channel in (*bench.kind.outputs, *bench.kind.commands):
        _check_alive(recording, channel)
    for channel in bench.kind.outputs:
        sigma = None if bench.noise is None else bench.noise.of(channel)
        noise = noise_of(recording[channel])
        rounded = noise < NOISY * quantisation_step(recording[channel])
        clipped = () if rounded else tuple(_clipped(recording, channel))
        yield from clipped
        if sigma is not None and not clipped:
            yield from _frozen(recording, channel, sigma)
        if bench.noise is not None and noise and not rounded:
            yield from _off_the_stated_noise(recording, bench.noise, channel, noise)
    controller = bench.controller
    if "x_ref" not in recording or isinstance(controller, NoController | NestedController):
        return
    if isinstance(controller, ProportionalController):
        yield from _not_in_opposition(recording, bench, controller)
    if isinstance(controller, ProportionalController) and controller.sample_time is None:
        yield from _off_the_law(recording, controller)
    else:
        yield from _off_the_replayed_law(recording, bench)


def _check_alive(recording: Recording, channel: str) -> None:
    values = recording[channel]
    if np.ptp(values) == 0:
        raise CaseError(
            f"{recording.where(0)}: `{channel}` stays at {values[0]:g} {UNITS[channel]} in all "
            f"{values.size} rows: a dead sensor or no excitation; record again"
        )


def _frozen(recording: Recording, channel: str, sigma: float) -> Iterator[Finding]:
    values = recording[channel]
    step = quantisation_step(values)
    if step > sigma:
        yield Finding(
            Grade.NOTE,
            "coarse quantisation",
            channel,
            f"`{channel}` is quantised to {step:.3g} {UNITS[channel]}, more than its noise of "
            f"{sigma:.3g} {UNITS[channel]}.",
            source=recording.name,
        )
        return
    start, length = longest_run(values)
    if length < FROZEN_ROWS:
        return
    message = (
        f"`{channel}` stays at {values[start]:g} {UNITS[channel]} for {length} rows although its "
        f"noise is {sigma:.3g} {UNITS[channel]}"
    )
    if length >= FROZEN_SHARE * values.size:
        raise CaseError(
            f"{recording.where(start)}: {message}: a frozen sensor; cut these rows out or record "
            "again"
        )
    yield Finding(
        Grade.CAUTION,
        "frozen sensor",
        channel,
        f"row {start + 1}: {message}; check the sensor, or cut these rows out.",
        source=recording.name,
    )


def _clipped(recording: Recording, channel: str) -> Iterator[Finding]:
    """Yield a channel that stays exactly at its extreme value although it is noisy, repeatedly."""
    values = recording[channel]
    for limit, side in ((values.max(), "upper"), (values.min(), "lower")):
        at_limit = np.flatnonzero(values == limit)
        stretches = np.split(at_limit, np.flatnonzero(np.diff(at_limit) > 1) + 1)
        clipped = [rows for rows in stretches if rows.size >= CLIPPED_ROWS]
        count = sum(rows.size for rows in clipped)
        if len(clipped) >= FEWEST_CLIPPED:
            yield Finding(
                Grade.SEVERE if count > CLIPPED_SHARE * values.size else Grade.CAUTION,
                "clipped channel",
                channel,
                f"row {clipped[0][0] + 1}: `{channel}` is clipped at its {side} limit "
                f"{limit:.6g} {UNITS[channel]} in {count} of {values.size} rows; choose a wider "
                "range of the sensor or the converter, or cut these rows out.",
                source=recording.name,
            )


def _not_in_opposition(
    recording: Recording, bench: AnyBench, controller: ProportionalController
) -> Iterator[Finding]:
    u_P, u_N = recording["u_P"], recording["u_N"]
    one_valve = getattr(bench, "arrangement", None) is Arrangement.ONE_5_3
    expected = (0.0 if one_valve else 2 * controller.u_0) - u_P
    meant = "2 u_0 − `u_P`" if controller.u_0 and not one_valve else "−`u_P`"
    k = int(np.abs(u_N - expected).argmax())
    if abs(u_N[k] - expected[k]) > LAW_TOLERANCE * np.abs(u_P).max():
        yield Finding(
            Grade.CAUTION,
            "valves not in opposition",
            "u_P, u_N",
            f"row {k + 1}: `u_N` = {u_N[k]:g} V is not {meant} = {expected[k]:g} V as the "
            "control law has it; check the columns, or the law in bench.json.",
            source=recording.name,
        )


def _off_the_replayed_law(recording: Recording, bench: AnyBench) -> Iterator[Finding]:
    # What follows needs CasADi, which readers do without where no such law is stated.
    from pneumo_casadi.data.control.law import ControlLaw
    from pneumo_casadi.data.control.memory import unexplained_share

    arrangement = getattr(bench, "arrangement", Arrangement.TWO_3_2)
    law = ControlLaw(bench.controller, recording.dt, arrangement)
    u = recording.stack(bench.kind.commands).T
    off = unexplained_share(law, recording["x_ref"], recording["x"], u)
    if off > LAW_TOLERANCE:
        yield Finding(
            Grade.NOTE,
            "off the control law",
            "u_P, controller",
            f"The commands differ from those that the law of bench.json gives on the recorded "
            f"positions by {100 * off:.0f} % rms; closed-loop simulation will not follow the "
            "record.",
            source=recording.name,
        )


def _off_the_law(recording: Recording, controller: ProportionalController) -> Iterator[Finding]:
    law = controller.gain * (recording["x_ref"] - recording["x"])
    u = recording["u_P"] - controller.u_0
    inside = np.abs(u) < 0.98 * controller.u_max
    u, law = u[inside], law[inside]
    if not law.size or not law @ law:
        return
    slope = float(u @ law / (law @ law))
    if abs(1e3 * slope - 1) < LAW_TOLERANCE:
        raise CaseError(
            f"{recording.source}: `u_P` is {slope:.3g} times gain (x_ref − x), expected 1; are "
            "`x` and `x_ref` in mm?"
        )
    off = float(np.linalg.norm(u - law)) / max(float(np.linalg.norm(u)), 1e-300)
    if off > LAW_TOLERANCE:
        yield Finding(
            Grade.NOTE,
            "off the control law",
            "u_P, controller",
            f"`u_P` differs from gain (x_ref − x) by {100 * off:.0f} % rms; closed-loop simulation "
            "will not follow the record.",
            source=recording.name,
        )


def _off_the_stated_noise(
    recording: Recording, stated: SensorNoise, channel: str, sigma: float
) -> Iterator[Finding]:
    """Yield that a sensor has other noise than stated: its accuracy hides the misfit of a model."""
    expected = stated.of(channel)
    if not expected or 1 / NOISE_RATIO < sigma / expected < NOISE_RATIO:
        return
    key = "p_Pa" if channel in ("p_P", "p_N") else column_name(channel)
    yield Finding(
        Grade.CAUTION,
        "stated noise",
        channel,
        f"`{channel}` has noise of {sigma:.3g} {UNITS[channel]} per sample, the bench states "
        f"{expected:.3g}: what a model leaves is held against the noise stated; correct it.",
        "bench.json",
        {"sensor_noise": noise_content(stated) | {key: float(f"{sigma:.3g}")}},
        recording.name,
    )
