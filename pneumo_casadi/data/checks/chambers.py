"""Which chamber is which: the signs that eq. 1 demands of pressures, commands and velocity.

In each chamber a positive command fills and so raises the pressure, and motion that opens the
chamber lowers it. The partial correlations of the pressure rate with u and with p ẋ therefore
have known signs. Swapped chambers flip all of them, swapped commands those with u, a reversed
position those with p ẋ. On a single-rod cylinder the mean effort tells swapped areas.
"""

import numpy as np
from scipy.signal import butter, sosfiltfilt

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray

BLOCK = 0.005  # means over 5 ms: fast enough for the axis, slow enough for the noise
CUT_OFF = 20.0
FEWEST_BLOCKS = 100
CLEAR = 0.4  # partial correlations below this decide nothing
LARGE_EFFORT = 0.08  # of the supply force
OUTWEIGHS = 4.0


def check_chambers(recording: Recording, bench: Bench) -> tuple[str, ...]:
    """Check that chambers, commands, position and areas are those of P and N.

    Returns
    -------
    tuple of str
        A note where the record is too short or too quiet to tell, or the pressures look gauge.

    Raises
    ------
    CaseError
        If the signs of eq. 1 hold only after a swap.
    """
    signs = chamber_correlations(recording)
    if signs is None or np.abs(signs).min() < CLEAR:
        return (f"{recording.source}: too short or too quiet to tell the chambers apart",)
    finding = f"{recording.source}: rows 1 to {recording.N}: {_measured(signs)}"
    command, motion = np.sign(signs[:, 0]), np.sign(signs[:, 1]) * [-1, 1]
    if not (command == command[0]).all() or not (motion == motion[0]).all():
        raise CaseError(
            f"{finding}: the chambers contradict each other; are "
            "`p_P_Pa` and `p_N_Pa` two sensors, `u_P_V` and `u_N_V` two valves?"
        )
    remedy = {
        (-1.0, -1.0): "are the columns `p_P_Pa` and `p_N_Pa` (chambers P and N) swapped?",
        (-1.0, 1.0): "are the columns `u_P_V` and `u_N_V` swapped, or the valves reversed?",
        (1.0, -1.0): "does `x_m` count the wrong way? It must grow as chamber P opens",
    }.get((float(command[0]), float(motion[0])))
    if remedy:
        raise CaseError(f"{finding}, against eq. 1; {remedy}")
    return _check_areas(recording, bench)


def chamber_correlations(recording: Recording) -> FloatArray | None:
    """Return the partial correlations of the pressure rates with command and motion.

    Parameters
    ----------
    recording : Recording
        With u_P, u_N [V], p_P, p_N [Pa] and x [m].

    Returns
    -------
    (2, 2) array or None
        Rows P and N; columns: with u at given p ẋ, with p ẋ at given u (p itself and a
        constant always given). Expected signs by eq. 1: [[+, −], [+, +]]. None where
        the record is shorter than half a second.
    """
    n = max(1, round(BLOCK / recording.dt))
    blocks = recording.N // n
    if blocks < FEWEST_BLOCKS:
        return None
    dt = n * recording.dt
    low_pass = butter(2, min(CUT_OFF, 0.2 / dt), fs=1 / dt, output="sos")

    def smooth(channel: str) -> FloatArray:
        means = recording[channel][: blocks * n].reshape(blocks, n).mean(axis=1)
        return np.asarray(sosfiltfilt(low_pass, means), dtype=float)

    v = np.gradient(smooth("x"), dt)
    rows = []
    for chamber in "PN":
        u, p = smooth(f"u_{chamber}"), smooth(f"p_{chamber}")
        rate, motion = np.gradient(p, dt), p * v
        rows.append([_partial(rate, u, motion, p), _partial(rate, motion, u, p)])
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


def _check_areas(recording: Recording, bench: Bench) -> tuple[str, ...]:
    p_P, p_N = float(recording["p_P"].mean()), float(recording["p_N"].mean())

    def effort(S_P: float, S_N: float, offset: float = 0.0) -> float:
        """Return the mean of S_P p_P − S_N p_N − F_ext (eq. 1, 2), by the supply force."""
        force = S_P * (p_P + offset) - S_N * (p_N + offset) - (S_P - S_N) * bench.p_ext
        return force / (bench.p_supply * max(S_P, S_N))

    as_given = effort(bench.S_P, bench.S_N)
    swapped = effort(bench.S_N, bench.S_P)
    gauge = effort(bench.S_P, bench.S_N, bench.p_ext)
    if abs(as_given) > max(LARGE_EFFORT, OUTWEIGHS * abs(swapped)):
        raise CaseError(
            f"{recording.source}: the mean effort S_P p_P − S_N p_N − (S_P − S_N) p_ext is "
            f"{100 * as_given:.1f} % of the supply force, and {100 * swapped:.1f} % with the areas "
            f"swapped; are `S_P` = {bench.S_P:g} m² and `S_N` = {bench.S_N:g} m² of the bench "
            "swapped? If a constant load explains it, load with check=False"
        )
    if abs(as_given) > max(LARGE_EFFORT / 4, OUTWEIGHS * abs(gauge)):
        return (
            f"{recording.source}: the mean effort is {100 * as_given:.1f} % of the supply force, "
            f"and {100 * gauge:.1f} % if the pressures are gauge; give absolute pressures",
        )
    return ()
