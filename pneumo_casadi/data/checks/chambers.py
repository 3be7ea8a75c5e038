"""Which chamber is which: the signs that eq. 1 demands of pressures, commands and velocity.

In each chamber a positive command fills and so raises the pressure, and motion that opens the
chamber lowers it. The partial correlations of the pressure rate with u and with p ẋ therefore
have known signs. Swapped chambers flip all of them, swapped commands those with u, a reversed
position those with p ẋ.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from pneumo_casadi.data.checks.finding import ContradictionError, Finding, Grade
from pneumo_casadi.data.checks.smoothed import SmoothedRecord
from pneumo_casadi.data.readers.column_entries import ColumnEntries
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray

CLEAR = 0.4  # partial correlations below this decide nothing


def check_chambers(record: SmoothedRecord, entries: ColumnEntries) -> Iterator[Finding]:
    """Check that chambers, commands and position are those of P and N.

    Yields
    ------
    Finding
        Where the record is too quiet to tell.

    Raises
    ------
    CaseError
        If the signs of eq. 1 hold only after a swap.
    """
    recording, signs = record.recording, chamber_correlations(record)
    if np.abs(signs).min() < CLEAR:
        yield cannot_tell(recording)
        return
    measured = f"{recording.source}: rows 1 to {recording.N}: {_measured(signs)}"
    command, motion = np.sign(signs[:, 0]), np.sign(signs[:, 1]) * [-1, 1]
    if not (command == command[0]).all() or not (motion == motion[0]).all():
        raise CaseError(
            f"{measured}: the chambers contradict each other; are "
            "`p_P_Pa` and `p_N_Pa` two sensors, `u_P_V` and `u_N_V` two valves?"
        )
    if command[0] > 0 and motion[0] > 0:
        return
    if motion[0] > 0:
        name, about = "swapped commands", "u_P, u_N"
        question = "are the columns `u_P_V` and `u_N_V` swapped, or the valves reversed?"
        suggestion = _swapped(entries, "u_P", "u_N")
    elif command[0] > 0:
        name, about = "reversed position", "x"
        question = "does `x_m` count the wrong way? It must grow as chamber P opens."
        suggestion = entries.corrected("x", factor=-1.0) | (
            entries.corrected("x_ref", factor=-1.0) if "x_ref" in recording else {}
        )
    else:
        name, about = "swapped chambers", "p_P, p_N"
        question = "are the columns `p_P_Pa` and `p_N_Pa` (chambers P and N) swapped?"
        suggestion = _swapped(entries, "p_P", "p_N")
    # The question comes first: the first line of a message is what is read.
    raise ContradictionError(
        Finding(
            Grade.SEVERE,
            name,
            about,
            f"{recording.source}: {question} Rows 1 to {recording.N} contradict eq. 1: "
            f"{_measured(signs)}.",
            "columns.json",
            suggestion,
        )
    )


def cannot_tell(recording: Recording) -> Finding:
    """Return the finding of a record in which the chambers cannot be told apart."""
    return Finding(
        Grade.NOTE,
        "chambers not told apart",
        "p_P, p_N",
        "too short or too quiet to tell the chambers apart; record more motion.",
        source=recording.name,
    )


def _swapped(entries: ColumnEntries, first: str, second: str) -> dict[str, Any]:
    return entries.corrected(first, taken_from=second) | entries.corrected(second, taken_from=first)


def chamber_correlations(record: SmoothedRecord) -> FloatArray:
    """Return the partial correlations of the pressure rates with command and motion.

    Parameters
    ----------
    record : SmoothedRecord
        With u_P, u_N [V], p_P, p_N [Pa] and x [m].

    Returns
    -------
    (2, 2) array
        Rows P and N; columns: with u at given p ẋ, with p ẋ at given u (p itself and a
        constant always given). Expected signs by eq. 1: [[+, −], [+, +]].
    """
    rows = []
    for name, chamber in record.chambers.items():
        u, rate, motion = (
            record.smooth(record.recording[f"u_{name}"]),
            chamber.p_rate,
            chamber.p * record.v,
        )
        rows.append([_partial(rate, u, motion, chamber.p), _partial(rate, motion, u, chamber.p)])
    return np.array(rows)


def _partial(y: FloatArray, z: FloatArray, *given: FloatArray) -> float:
    """Return the correlation of y and z once the given signals are taken out of both."""
    basis = np.column_stack([*given, np.ones_like(y)])
    basis = np.linalg.qr(basis / np.maximum(np.abs(basis).max(axis=0), 1e-300))[0]
    y, z = (signal - basis @ (basis.T @ signal) for signal in (y, z))
    norm = np.linalg.norm(y) * np.linalg.norm(z)
    return float(y @ z / norm) if norm > 0 else 0.0


def _measured(signs: FloatArray) -> str:
    (u_P, v_P), (u_N, v_N) = signs
    return (
        f"partial correlations of dp_P/dt with u_P {u_P:+.2f} (expected > 0) and with p_P dx/dt "
        f"{v_P:+.2f} (< 0), of dp_N/dt with u_N {u_N:+.2f} (> 0) and with p_N dx/dt "
        f"{v_N:+.2f} (> 0)"
    )
