"""Delay of the command: against the control law, or against what the pressures do.

Row k holds what the controller made of the same row. A loop that logs the command before it has
computed the new one has u one row late.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.bench.controllers import ProportionalController
from pneumo_casadi.data.checks.finding import Finding, Grade
from pneumo_casadi.data.checks.smoothed import least_squares
from pneumo_casadi.data.readers.column_entries import ColumnEntries
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.parameters import FloatArray

MOST_ROWS = 5
"""Delays looked for [rows]: buffers of a logger are one or two deep."""
SMALLER = 0.25
"""What the right delay leaves of the variance of u, over what none leaves, where the law is only
near the one stated. One row off leaves a hundred times more wherever the reference jumps."""
LAW_HOLDS, FEWEST_ROWS, SLIGHTLY_SMALLER = 1e-3, 1000, 0.95
"""Where the law explains all but this share of the variance, only rounding is left, and so many
rows tell it from misfit: then a slight difference is enough, as slow motion gives it."""
ONE_LAW = 0.02
"""Gains of reference and position that differ by less are those of one law."""
JUMP, JUMP_SHARE = 12.0, 0.03
"""A step of the command: over the usual difference of neighbours, and over the range."""
ROWS_BEFORE = 20
"""Rows before a step from which the pressure is continued; steps lie further apart than that."""
FEWEST_STEPS = 10
CERTAIN = 5.0
"""Mean answer of the pressures over its standard error: p < 1e-6, rows and steps looked at."""


def check_timing(recording: Recording, bench: Bench, entries: ColumnEntries) -> Iterator[Finding]:
    """Yield a finding where the commands are late or early."""
    law = bench.controller
    # A law that is sampled slower than the record lags by half its period of its own accord.
    by_row = not law.sample_time or law.sample_time < 1.5 * recording.dt
    if isinstance(law, ProportionalController) and "x_ref" in recording and by_row:
        rows = rows_late_by_law(recording, law)
        evidence = "gain (x_ref − x) fits best so"
    else:
        rows = rows_late_by_pressures(recording)
        evidence = "the pressures answer before its steps"
    if rows:
        suggestion: dict[str, object] = {}
        for channel in ("u_P", "u_N"):
            suggestion |= entries.corrected(channel, rows_late=rows)
        yield Finding(
            Grade.SEVERE,
            "delay of u",
            "u_P, u_N",
            f"`u_P` and `u_N` are {abs(rows)} row{'s' if abs(rows) > 1 else ''} "
            f"{'late' if rows > 0 else 'early'} ({1e3 * abs(rows) * recording.dt:g} ms): "
            f"{evidence}; shift them.",
            "columns.json",
            suggestion,
            recording.name,
        )


def rows_late_by_law(recording: Recording, controller: ProportionalController) -> int:
    """Return by how many rows u_P is late against gain (x_ref − x), 0 where the law cannot tell.

    Where reference, position and speed would need gains of their own beside the delay, they are
    given them: a position of another scale, or one that is late, is no delay of the command.

    Parameters
    ----------
    recording : Recording
        With u_P [V], x and x_ref [m].
    controller : ProportionalController
        The law; its gains and a null voltage are fitted to the record.

    Returns
    -------
    int
        Negative where u_P is early.
    """
    x_ref, x = recording["x_ref"], recording["x"]
    inner = slice(MOST_ROWS, recording.N - MOST_ROWS)
    unlimited = np.abs(recording["u_P"][inner] - controller.u_0) < 0.98 * controller.u_max
    if int(unlimited.sum()) < 10 * MOST_ROWS:
        return 0
    rows_used = np.flatnonzero(unlimited) + MOST_ROWS
    rows = _best_delay(recording["u_P"], np.array([x_ref - x]), rows_used)
    if rows:
        parts = np.array([x_ref, x, np.gradient(x)])
        columns = [np.ones(rows_used.size), *parts[:, rows_used - rows]]
        _, g_ref, g_x, g_v = least_squares(columns, recording["u_P"][rows_used])[0]
        # The gain of the speed over that of the reference is a delay of the position in rows.
        if abs(g_ref + g_x) > ONE_LAW * abs(g_ref) or abs(g_v) > abs(g_ref):
            return _best_delay(recording["u_P"], parts, rows_used)
    return rows


def _best_delay(u: FloatArray, law: FloatArray, rows_used: NDArray[np.intp]) -> int:
    """Return the delay [rows] with which rows of a law explain u best, 0 where none surely does."""
    delays = range(-MOST_ROWS, MOST_ROWS + 1)
    left = [_unexplained(law[:, rows_used - d], u[rows_used]) for d in delays]
    best = int(np.argmin(left))
    certain = left[best] < LAW_HOLDS and u.size >= FEWEST_ROWS and abs(delays[best]) < MOST_ROWS
    needed = SLIGHTLY_SMALLER if certain else SMALLER
    return delays[best] if left[best] < needed * left[MOST_ROWS] else 0


def _unexplained(law: FloatArray, u: FloatArray) -> float:
    """Return the share of the variance of u that a constant and the rows of a law leave."""
    law, u = law - law.mean(axis=1, keepdims=True), u - u.mean()
    products, squares = law @ u, float(u @ u)
    gains = np.linalg.lstsq(law @ law.T, products, rcond=None)[0]
    return 1.0 - float(gains @ products) / squares if squares > 0 else 1.0


def rows_late_by_pressures(recording: Recording) -> int:
    """Return by how many rows the command is late because pressures answer before its steps.

    A step in row k acts from t[k] on, so the first pressure that can differ is that of row k + 1.
    Each pressure is continued as a straight line from before the step; what it deviates by, signed
    as the step, is averaged over the steps of both commands.

    Parameters
    ----------
    recording : Recording
        With u_P, u_N [V], p_P and p_N [Pa].

    Returns
    -------
    int
        0 where the record has few steps, or the pressures answer later.
    """
    answers = np.concatenate([_answers(recording, chamber) for chamber in "PN"])
    if len(answers) < FEWEST_STEPS:
        return 0
    for row in range(1, MOST_ROWS + 1):  # column MOST_ROWS is the row of the step itself
        rise, later = (answers[:, k] - answers[:, :row].mean(axis=1) for k in (row, row + 1))
        # An answer goes on to grow, what is there by chance does not.
        if later.mean() > rise.mean() > CERTAIN * rise.std() / np.sqrt(len(rise)):
            return MOST_ROWS + 1 - row
    return 0


def _answers(recording: Recording, chamber: str) -> FloatArray:
    """Return the signed deviations of a pressure around each step, (steps, 2 MOST_ROWS + 1)."""
    u, p = recording[f"u_{chamber}"], recording[f"p_{chamber}"]
    differences = np.diff(u)
    usual = float(np.median(np.abs(differences)))
    large = np.abs(differences) > max(JUMP * usual, JUMP_SHARE * float(np.ptp(u)))
    k = np.flatnonzero(large) + 1
    k = k[(k > ROWS_BEFORE) & (k < recording.N - MOST_ROWS)]
    k = k[np.diff(k, prepend=-ROWS_BEFORE - 1) > ROWS_BEFORE]
    before, around = np.arange(-ROWS_BEFORE, -MOST_ROWS), np.arange(-MOST_ROWS, MOST_ROWS + 1)
    line = np.linalg.pinv(np.column_stack([np.ones(before.size), before]))
    level, slope = line @ p[k[:, None] + before].T
    deviation = p[k[:, None] + around] - level[:, None] - slope[:, None] * around
    signed: FloatArray = np.sign(differences[k - 1])[:, None] * deviation
    return signed
