"""Rows that do not continue those before and after: a spike, or others lost between them."""

from collections.abc import Iterator, Mapping

import numpy as np

from pneumo_casadi.data.checks.finding import Finding, Grade
from pneumo_casadi.data.recording.channels import UNITS
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.data.recording.samples import (
    NEIGHBOURS,
    largest_around,
    noise_of,
    quantisation_step,
)
from pneumo_casadi.parameters import FloatArray

CONTINUOUS = ("x", "p_P", "p_N")  # a mass and a chamber take many rows to get under way
SPIKE_NOISE, SPIKE_STEPS = 100.0, 10.0
"""Noise, and largest step around, that a single row exceeds. On 160 simulated records spikes reach
6 sigma, on real ones (EMPS, seal friction) 77 sigma or 5 steps."""
JUMP, JUMP_OF_X = 10.0, 1.5
"""Product of the steps of all channels, each over the largest around it, and that of the position:
on the records named above the product stays below 3.2. Pressures alone may jump."""
NOISE_FLOOR = 2.0
"""Sigmas that count as a step around at least, for channels that are rounded to nothing at rest."""


def check_continuity(recording: Recording) -> Iterator[Finding]:
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
            f"{values[k + 1]:.6g} {unit}, {size[k - 1] / noise:.0f} times its noise or step "
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
