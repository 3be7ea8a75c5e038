"""Delay of the command: against the control law, or against what the pressures do.

Row k holds what the controller made of the same row. A loop that logs the command before it has
computed the new one has u one row late.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.bench.controllers import ProportionalController
from pneumo_casadi.data.checks.column_entries import ColumnEntries
from pneumo_casadi.data.checks.finding import Finding, Grade
from pneumo_casadi.data.checks.metered_flow import MeteredFlow
from pneumo_casadi.data.checks.smoothed import SmoothedChamber, SmoothedRecord, least_squares
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
ACAUSAL = 0.2
"""Time by which pressures may lead the command, over the sample time. Nothing leads its cause;
errors of the balance move the estimate by up to 0.1 rows, a late row moves it by one."""


def check_timing(
    record: SmoothedRecord, bench: Bench, flows: Mapping[str, MeteredFlow], entries: ColumnEntries
) -> Iterator[Finding]:
    """Yield a finding where the commands are late or early."""
    recording = record.recording
    if isinstance(bench.controller, ProportionalController) and "x_ref" in recording:
        rows = rows_late_by_law(recording, bench.controller)
        evidence = "gain (x_ref − x) fits best so"
    elif {"P", "N"} <= flows.keys():
        rows = 1 if _pressures_lead(record, flows) else 0
        evidence = "the pressures answer before it"
    else:
        return
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

    Parameters
    ----------
    recording : Recording
        With u_P [V], x and x_ref [m].
    controller : ProportionalController
        The law; its gain and a null voltage are fitted to the record.

    Returns
    -------
    int
        Negative where u_P is early.
    """
    law = recording["x_ref"] - recording["x"]
    inner = slice(MOST_ROWS, recording.N - MOST_ROWS)
    u = recording["u_P"][inner]
    unlimited = np.abs(u) < 0.98 * controller.u_max
    if int(unlimited.sum()) < 10 * MOST_ROWS:
        return 0
    delays = range(-MOST_ROWS, MOST_ROWS + 1)
    left = [_unexplained(np.roll(law, rows)[inner][unlimited], u[unlimited]) for rows in delays]
    best = int(np.argmin(left))
    certain = left[best] < LAW_HOLDS and u.size >= FEWEST_ROWS and abs(delays[best]) < MOST_ROWS
    needed = SLIGHTLY_SMALLER if certain else SMALLER
    return delays[best] if left[best] < needed * left[MOST_ROWS] else 0


def _unexplained(law: FloatArray, u: FloatArray) -> float:
    """Return the share of the variance of u that a straight line over the law leaves."""
    law, u = law - law.mean(), u - u.mean()
    norm = float(law @ law) * float(u @ u)
    return 1.0 - float(law @ u) ** 2 / norm if norm > 0 else 1.0


def _pressures_lead(record: SmoothedRecord, flows: Mapping[str, MeteredFlow]) -> bool:
    leads = [_lead(record, record.chambers[name], flows[name]) for name in "PN"]
    return min(leads) > ACAUSAL * record.recording.dt


def _lead(record: SmoothedRecord, chamber: SmoothedChamber, flow: MeteredFlow) -> float:
    """Return the time by which a chamber's pressure answers before the command [s].

    The mass balance q(t + δ) = X_1 ṗ + X_2 x ṗ + X_3 p ẋ, to first order in the lead δ.
    """
    inner, q_m = record.inner, record.flow(flow, chamber.name)
    columns = [
        chamber.p_rate,
        record.x * chamber.p_rate,
        record.v * chamber.p,
        -np.gradient(q_m, record.smooth.dt),
    ]
    coefficients, _ = least_squares([column[inner] for column in columns], q_m[inner])
    return float(coefficients[-1])
