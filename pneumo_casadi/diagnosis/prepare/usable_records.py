"""Records that can be diagnosed, and those that must be refused."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.data import Recording
from pneumo_casadi.errors import CaseError
from pneumo_casadi.signals.bandwidth import white_noise_std

#: Shortest record that holds enough rows after the filters' edges [s].
SHORTEST = 2.0
#: A record of just so many samples may come out shorter by rounding, as a share.
ROUNDING = 1e-3
#: A channel that varies less than so many times its own noise shows nothing of the axis.
LEAST_RATIO = 20.0
#: Least share of the time in which a servo axis must move, and what counts as moving: this share of
#: the travel in 50 ms. A slow sine of 10 s moves by a hundredth and more most of the time; an axis
#: that creeps out of a dead zone is slow too, and shows what holds it.
LEAST_MOVING, SLOWEST = 0.05, 0.005


def require_usable(records: Sequence[Recording], channels: Sequence[str]) -> None:
    """Refuse records that are too short, made of noise, or of rest.

    Raises
    ------
    CaseError
        Naming file, channel and remedy.
    """
    for record in records:
        if record.duration < SHORTEST * (1 - ROUNDING):
            raise CaseError(
                f"{record.source}: {record.duration:.3g} s are too short for a diagnosis: record "
                f"at least {SHORTEST:g} s, better 20 s, of varied motion"
            )
        for name in channels:
            _refuse_flat(record, name)
        _refuse_rest(record)


def require_rows(used: Sequence[NDArray[np.bool_]], source: str) -> None:
    """Refuse held-out records of which no row of some balance counts: no gap would ever show there.

    Parameters
    ----------
    used : sequence of (ne, m) array
        By record: whether a row of a balance counts.
    source : str
        What the records are called.

    Raises
    ------
    CaseError
        With the remedy.
    """
    if not np.hstack(used).any(axis=1).all():
        raise CaseError(
            f"{source}: too slow throughout for a row of the force balance that friction at rest "
            "does not disturb; hold out a record of faster motion"
        )


def _refuse_flat(record: Recording, name: str) -> None:
    values = record[name]
    spread, noise = float(np.std(values)), white_noise_std(values)
    if spread <= LEAST_RATIO * noise or spread == 0.0:
        raise CaseError(
            f"{record.source}: {name} varies by {spread:.3g}, its noise is {noise:.3g}: the record "
            "shows noise or rest, and no cause can be told from it. Excite the axis, for example "
            "with a chirp from 0 to 2 Hz and squares of several heights"
        )


def _refuse_rest(record: Recording) -> None:
    x, fs = record["x"], 1 / record.dt
    step = max(1, round(0.05 * fs))
    travelled = np.abs(x[step:] - x[:-step])
    moving = float(np.mean(travelled > max(SLOWEST * np.ptp(x), LEAST_RATIO * white_noise_std(x))))
    if moving < LEAST_MOVING:
        raise CaseError(
            f"{record.source}: the axis moves during {100 * moving:.0f} % of the record only; "
            "friction and flows cannot be told at rest: record more motion"
        )
