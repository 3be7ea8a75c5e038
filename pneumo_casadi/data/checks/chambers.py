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

#: Partial correlations below this decide nothing.
CLEAR = 0.4
#: Nor do those of a signal of whose scatter the others leave less than this share: on a sine all
#: signals are sines, and what is left of one is what eq. 1 in its linear form does not hold.
OWN = 0.25


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
    if np.abs(signs).min() < CLEAR or own_scatter(record).min() < OWN:
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
    return np.array(
        [
            [_partial(p_rate, u, motion, p), _partial(p_rate, motion, u, p)]
            for p_rate, u, motion, p in _signals(record)
        ]
    )


def own_scatter(record: SmoothedRecord) -> FloatArray:
    """Return the share of the scatter of u that p ẋ and p leave, and of p ẋ that u and p leave.

    Returns
    -------
    (2, 2) array
        Rows P and N; columns u and p ẋ; 0 for a signal that is constant.
    """
    return np.array(
        [[_share(u, motion, p), _share(motion, u, p)] for _, u, motion, p in _signals(record)]
    )


def _signals(record: SmoothedRecord) -> Iterator[tuple[FloatArray, ...]]:
    """Yield ṗ, u, p ẋ and p of each chamber."""
    for name, chamber in record.chambers.items():
        u = record.smooth(record.recording[f"u_{name}"])
        yield chamber.p_rate, u, chamber.p * record.v, chamber.p


def _partial(y: FloatArray, z: FloatArray, *given: FloatArray) -> float:
    """Return the correlation of y and z once the given signals are taken out of both."""
    y, z = (_without(signal, *given) for signal in (y, z))
    norm = np.linalg.norm(y) * np.linalg.norm(z)
    return float(y @ z / norm) if norm > 0 else 0.0


def _share(signal: FloatArray, *given: FloatArray) -> float:
    """Return the share of the scatter of a signal that the given signals leave."""
    whole = np.linalg.norm(_without(signal))
    return float(np.linalg.norm(_without(signal, *given)) / whole) if whole > 0 else 0.0


def _without(signal: FloatArray, *given: FloatArray) -> FloatArray:
    """Return what the given signals and a constant do not give of a signal."""
    basis = np.column_stack([*given, np.ones_like(signal)])
    basis = np.linalg.qr(basis / np.maximum(np.abs(basis).max(axis=0), 1e-300))[0]
    rest: FloatArray = signal - basis @ (basis.T @ signal)
    return rest


def _measured(signs: FloatArray) -> str:
    (u_P, v_P), (u_N, v_N) = signs
    return (
        f"partial correlations of dp_P/dt with u_P {u_P:+.2f} (expected > 0) and with p_P dx/dt "
        f"{v_P:+.2f} (< 0), of dp_N/dt with u_N {u_N:+.2f} (> 0) and with p_N dx/dt "
        f"{v_N:+.2f} (> 0)"
    )
