"""Sensors and commands that do not behave: dead, frozen, clipped, coarse, or against the law."""

from collections.abc import Iterator, Mapping

import numpy as np

from pneumo_casadi.data.bench.controllers import (
    NestedController,
    NoController,
    ProportionalController,
)
from pneumo_casadi.data.bench.driven_bench import AnyBench
from pneumo_casadi.data.bench.valve_source import Arrangement
from pneumo_casadi.data.checks.finding import Finding, Grade
from pneumo_casadi.data.recording.channels import UNITS
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.data.recording.samples import (
    NEIGHBOURS,
    largest_around,
    longest_run,
    noise_of,
    quantisation_step,
)
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray

FROZEN_ROWS = 50  # noise of a quantum or more repeats a value this often with p < 1e-19
FROZEN_SHARE = 0.1
LAW_TOLERANCE = 0.1
NOISY = 0.3  # noise over quantum from which neighbours rarely agree: the noise of rounding itself
CLIPPED_ROWS = 5  # equal rows: noise of such size repeats the extreme value so often with p < 1e-4
FEWEST_CLIPPED = 2  # once may be a rest
CLIPPED_SHARE = 0.01  # of the rows, from which a fit follows the limit and not the axis
CONTINUOUS = ("x", "p_P", "p_N")  # a mass and a chamber take many rows to get under way
SPIKE_NOISE, SPIKE_STEPS = 100.0, 10.0
"""Noise, and largest step around, that a single row exceeds. On 160 simulated records spikes reach
6 sigma, on real ones (EMPS, seal friction) 77 sigma or 5 steps."""
JUMP, JUMP_OF_X = 10.0, 1.5
"""Product of the steps of all channels, each over the largest around it, and that of the position:
on the records named above the product stays below 3.2. Pressures alone may jump."""
NOISE_FLOOR = 2.0
"""Sigmas that count as a step around at least, for channels that are rounded to nothing at rest."""


def check_sensors(recording: Recording, bench: AnyBench) -> Iterator[Finding]:
    """Check that sensors live and commands follow the controller.

    Yields
    ------
    Finding
        Odd but possible: short frozen stretches, clipped channels, coarse quantisation, single rows
        far off, rows lost under a clock that runs on, commands off the law.

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
        clipped = tuple(_clipped(recording, channel))
        yield from clipped
        if sigma is not None and not clipped:
            yield from _frozen(recording, channel, sigma)
    yield from _discontinuous(recording)
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
    if noise_of(values) < NOISY * quantisation_step(values):
        return
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


def _discontinuous(recording: Recording) -> Iterator[Finding]:
    """Yield single rows that neither neighbour bears out, and rows before which others are lost.

    What changes within one row goes on changing in the rows after it, or did in those before.
    """
    if recording.N < 3 * NEIGHBOURS:
        return
    changes = {name: np.diff(recording[name]) for name in CONTINUOUS if name in recording}
    noise = {name: _noise(recording[name]) for name in changes}
    for name, step in changes.items():
        yield from _spikes(recording, name, step, noise[name])
    if "x" in changes:
        yield from _lost_rows(recording, changes, noise)


def _spikes(recording: Recording, name: str, step: FloatArray, noise: float) -> Iterator[Finding]:
    there, back = step[:-1], step[1:]
    size = np.where(there * back < 0, np.minimum(np.abs(there), np.abs(back)), 0.0)
    if size.max() <= SPIKE_NOISE * noise:
        return
    around = np.maximum(*largest_around(np.abs(step), 2))
    limit = np.maximum(SPIKE_STEPS * around, SPIKE_NOISE * noise)
    rows = np.flatnonzero(size > limit) + 1
    if rows.size:
        k, unit, values = int(rows[0]), UNITS[name], recording[name]
        yield Finding(
            Grade.CAUTION,
            "spike",
            name,
            f"row {k + 1}: `{name}` = {values[k]:.6g} {unit} between {values[k - 1]:.6g} and "
            f"{values[k + 1]:.6g} {unit}, {size[k - 1] / noise:.2g} times its noise "
            f"({rows.size} such row{'s' if rows.size > 1 else ''}); cut the record there, or "
            "correct the value.",
            source=recording.name,
        )


def _lost_rows(
    recording: Recording, changes: Mapping[str, FloatArray], noise: Mapping[str, float]
) -> Iterator[Finding]:
    longer = np.maximum(np.diff(recording.t) / recording.dt, 1.0)  # of a clock as recorded
    ratios = {}
    for name, step in changes.items():
        size = np.abs(step) / longer
        before, after = largest_around(size, 1)
        ratios[name] = size / np.maximum(np.maximum(before, after), NOISE_FLOOR * noise[name])
        if name == "x":  # a frozen sensor, or one that is read slowly, jumps where it stood still
            ratios[name][np.minimum(before, after) == 0.0] = 0.0
    product = np.prod([np.maximum(ratio, 1.0) for ratio in ratios.values()], axis=0)
    rows = np.flatnonzero((product > JUMP) & (ratios["x"] > JUMP_OF_X)) + 1
    rows = rows[(rows > NEIGHBOURS) & (rows < recording.N - NEIGHBOURS)]
    if rows.size:
        k = int(rows[np.argmax(product[rows - 1])])
        jumps = ", ".join(
            f"`{name}` by {changes[name][k - 1]:+.3g} {UNITS[name]} ({ratio[k - 1]:.2g} times the "
            "largest step around)"
            for name, ratio in ratios.items()
            if ratio[k - 1] > JUMP_OF_X
        )
        yield Finding(
            Grade.CAUTION,
            "lost rows",
            "t",
            f"row {k + 1}: within one row {jumps} changes, as if rows before it were lost although "
            f"`t` runs on ({rows.size} such row{'s' if rows.size > 1 else ''}); record t with "
            "every sample, or cut the record there and give the parts as separate files.",
            source=recording.name,
        )


def _noise(values: FloatArray) -> float:
    """Return the noise of a channel, or its quantum where that is larger; at least a trace."""
    return max(noise_of(values), quantisation_step(values), 1e-300)


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
