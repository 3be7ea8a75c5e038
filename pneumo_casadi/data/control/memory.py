"""What a controller remembered where a record begins: that with which it gives its commands."""

import numpy as np
from numpy.typing import ArrayLike

from pneumo_casadi.data.control.law import ControlLaw
from pneumo_casadi.parameters import FloatArray

#: Samples of the law, off the limits, whose commands tell its memory: filters of controllers forget
#: within some tens of samples, and the integrator shows in every one.
SAMPLES = 200
#: The law is piecewise linear in its memory: a Newton step for every change of the limits.
STEPS = 10
#: Shares of a step that are tried where limits make the whole one too long.
SHARES = (1.0, 0.5, 0.25, 0.125)
#: Samples of the law after which its memory is estimated anew in checks: five times as many as tell
#: it, so that most of the commands are predicted.
STRETCH = 5 * SAMPLES
#: Directions of the memory below this share of the largest have no effect on the commands.
SMALLEST = 1e-6


def memory_at_start(
    law: ControlLaw,
    x_ref: ArrayLike,
    x: ArrayLike,
    u: ArrayLike,
    v: float,
    guess: FloatArray | None = None,
) -> FloatArray:
    """Estimate the memory before the first row of a record by least squares of its commands.

    Parameters
    ----------
    law : ControlLaw
        The law that gave the commands.
    x_ref, x : (N,) array
        Recorded reference and position [m].
    u : (nu, N) array
        Recorded commands.
    v : float
        Velocity at the first row [m/s].
    guess : (n_memory,) array, optional
        Where to begin; by default integrators are empty and the axis has moved at `v`.

    Returns
    -------
    (n_memory,) array

    Notes
    -----
    Of a law that is sampled more slowly than the record, the row at which it is sampled first is
    that after which the commands change most.

    Examples
    --------
    >>> from pneumo_casadi.data.bench.pid_controllers import PidController
    >>> law = ControlLaw(PidController(k_p=10.0, u_max=5.0, k_i=100.0), 1e-3)
    >>> e = 0.01 * np.sin(0.1 * np.arange(50))
    >>> u, _ = law.replay(e, 0 * e, np.array([0.4, 0.0]))
    >>> memory_at_start(law, e, 0 * e, u, 0.0)[:1].round(6)
    array([0.4])
    """
    x_ref, x = np.asarray(x_ref, dtype=float), np.asarray(x, dtype=float)
    u = np.asarray(u, dtype=float)
    free = (u[0] > u[0].min()) & (u[0] < u[0].max())  # at a limit commands tell little
    rows = slice(0, int(np.searchsorted(np.cumsum(free), SAMPLES * law.rows)) + 1)
    x_ref, x, u = x_ref[rows], x[rows], u[:, rows]
    memory = law.rest(x_ref[0], x[0], v) if guess is None else guess
    if law.rows > 1 and guess is None:
        memory[law.n_own : -1] = u[:, 0]
        memory[-1] = (law.rows - _first_sample(u, law.rows)) % law.rows
    residual = u - law.replay(x_ref, x, memory)[0]
    for _ in range(STEPS if law.n_own else 0):
        jacobian = np.stack(
            [(law.replay(x_ref, x, memory + d)[0] - u + residual).ravel() for d in _changes(law)],
            axis=1,
        )
        step = np.linalg.lstsq(jacobian, residual.ravel(), rcond=SMALLEST)[0] @ _changes(law)
        for share in SHARES:
            new = u - law.replay(x_ref, x, memory + share * step)[0]
            if np.sum(new**2) < np.sum(residual**2):
                break
        else:
            break
        memory, residual = memory + share * step, new
    return memory


def _changes(law: ControlLaw) -> FloatArray:
    """Return small changes of each value of the law's own memory, shape (n_own, n_memory)."""
    return 1e-3 * np.diag(law.scales)[: law.n_own]


def _first_sample(u: FloatArray, rows: int) -> int:
    """Return the row, below `rows`, at which the law was sampled first."""
    change = np.abs(np.diff(u[0]))
    whole = change[: change.size // rows * rows].reshape(-1, rows).sum(axis=0)
    return (int(whole.argmax()) + 1) % rows


def unexplained_share(law: ControlLaw, x_ref: ArrayLike, x: ArrayLike, u: ArrayLike) -> float:
    """Return the part of recorded commands that a law does not give, rms over rms.

    Parameters
    ----------
    law : ControlLaw
        The law stated.
    x_ref, x : (N,) array
        Recorded reference and position [m].
    u : (nu, N) array
        Recorded commands.

    Notes
    -----
    The law is replayed over stretches of `STRETCH` samples, and its memory estimated anew at the
    first row of each: otherwise an integrator adds up the offset of a sensor over the record.
    """
    x_ref, x, u = (np.asarray(values, dtype=float) for values in (x_ref, x, u))
    length = STRETCH * law.rows
    off, memory = 0.0, None
    v = float(x[1] - x[0]) / law.dt
    for first in range(0, x.size, length):
        rows = slice(first, first + length)
        memory = memory_at_start(law, x_ref[rows], x[rows], u[:, rows], v, memory)
        given, before = law.replay(x_ref[rows], x[rows], memory)
        off += float(np.sum((u[:, rows] - given) ** 2))
        memory = law.after(before[:, -1], x_ref[rows][-1], x[rows][-1])
    return float(np.sqrt(off / max(float(np.sum(u**2)), np.finfo(float).tiny)))
