"""The clock of a recording: one time step, or an error that names the row where it breaks."""

from collections.abc import Callable
from enum import StrEnum
from itertools import pairwise

import numpy as np

from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray

JITTER = 0.05  # a step may differ from the sample time by this share, besides rounding
RARE = 0.05  # share of the steps up to which long ones are taken for lost samples
WANDER = 0.25  # a time stamp may stray from the straight line by this share of the sample time
LARGEST_DECIMALS = 9
CLOCK_TOLERANCE = 1e-3
"""Share by which the sample time of a record may differ from that of its bench: a model of the
axis is as wrong in time, and every sensor's gain is less certain."""
DAY = 86400.0  # s


class Clock(StrEnum):
    """How time stamps are read."""

    UNIFORM = "uniform"
    """Rounded stamps of a uniform clock; jitter and gaps are errors."""
    AS_RECORDED = "as recorded"
    """Real stamps: every interval has its own length, and gaps split a record."""


def sample_time(t: FloatArray, where: Callable[[int], str]) -> float:
    """Return the sample time of a uniform clock.

    Rounding of the time stamps to few decimals is tolerated, lost or repeated samples,
    jitter and drift are not.

    Parameters
    ----------
    t : (N,) array
        Finite time stamps [s], N ≥ 2.
    where : callable
        Turns an index into the words by which a message names the row.

    Returns
    -------
    float
        Slope of the least-squares line through the time stamps [s].

    Raises
    ------
    CaseError
        If time repeats, runs backward, jumps, jitters or drifts.

    Examples
    --------
    >>> round(sample_time(np.array([0.0, 0.1, 0.2, 0.3]), str), 12)
    0.1
    >>> sample_time(np.array([0.0, 0.1, 0.2, 0.5, 0.6]), lambda k: f"row {k + 1}")
    Traceback (most recent call last):
    ...
    pneumo_casadi.errors.CaseError: row 4: `t` jumps from 0.2 s to 0.5 s: 2 samples of 0.1 s are
    lost; cut the record there and give the parts as separate files, or write "clock": "as recorded"
    in bench.json
    """
    intervals = np.diff(t)
    check_forward(t, where)
    dt, *_ = usual_step(intervals)
    rounding = _rounding(t, dt)
    _check_steps(t, intervals, dt, rounding, where)
    _check_wander(t, rounding, where)
    return _slope(t)


def same_clock(dt: float, other: float) -> bool:
    """Return whether two records of one bench may have these sampling periods [s].

    Each of them may differ from the bench's by `CLOCK_TOLERANCE`, the one up and the other down.

    Examples
    --------
    >>> same_clock(1.0000e-3, 1.0001e-3), same_clock(1.00e-3, 1.01e-3)
    (True, False)
    """
    return abs(dt / other - 1) <= 2 * CLOCK_TOLERANCE


def check_forward(t: FloatArray, where: Callable[[int], str]) -> None:
    """Raise a CaseError at the first time stamp that is not after the one before it."""
    intervals = np.diff(t)
    wrong = np.flatnonzero(intervals <= 0)
    if wrong.size:
        k = int(wrong[0]) + 1
        verb = "repeats" if intervals[k - 1] == 0 else "runs backward from"
        # Back by a day, but for an hour of lost samples at most; other counters wrap elsewhere.
        midnight = abs(float(intervals[k - 1]) + DAY) < 3600.0
        raise CaseError(
            f"{where(k)}: `t` {verb} {t[k - 1]:.9g} s"
            + ("" if intervals[k - 1] == 0 else f" to {t[k]:.9g} s")
            + (
                f": a time of day that passes midnight; cut the record there, or add {DAY:g} s to "
                "t from there on"
                if midnight
                else "; remove the repeated rows, or write t with more decimals"
            )
        )


def usual_step(intervals: FloatArray, near: float = 0.6) -> tuple[float, float, float]:
    """Return the mean [s] and the spread [s] of the steps near the median, and their share [1].

    Jumps do not move the mean, rounding averages out.

    Parameters
    ----------
    intervals : (n,) array
        Steps of a clock [s].
    near : float, optional
        Steps within this share of the median count.

    Examples
    --------
    >>> steps = np.array([0.9, 1.1, 1.0, 1.4, 1.0])
    >>> [round(value, 3) for value in (*usual_step(steps), *usual_step(steps, near=0.25))]
    [1.08, 0.172, 1.0, 1.0, 0.071, 0.8]
    """
    median = np.median(intervals)
    usual = intervals[np.abs(intervals - median) < near * median]
    return float(usual.mean()), float(usual.std()), usual.size / intervals.size


def _rounding(t: FloatArray, dt: float) -> float:
    """Return the rounding of the time stamps where it is visible beside the sample time."""
    for decimals in range(LARGEST_DECIMALS + 1):
        unit = 10.0**-decimals
        scaled = t / unit
        if np.abs(scaled - np.round(scaled)).max() < 1e-6 * max(1.0, np.abs(scaled).max() * 1e-8):
            # Coarser rounding than a third of dt cannot be told from lost samples.
            return unit if unit <= dt / 3 else 0.0
    return 0.0


def _check_steps(
    t: FloatArray, intervals: FloatArray, dt: float, rounding: float, where: Callable[[int], str]
) -> None:
    wrong = np.flatnonzero(np.abs(intervals - dt) > JITTER * dt + rounding)
    if not wrong.size:
        return
    k = int(wrong[0]) + 1
    lost = round(float(intervals[k - 1]) / dt) - 1
    # Long steps all over are the way the clock goes or is rounded, not lost samples.
    rare = wrong.size <= max(1, RARE * intervals.size)
    if rare and intervals[k - 1] > 1.5 * dt:
        raise CaseError(
            f"{where(k)}: `t` jumps from {t[k - 1]:.9g} s to {t[k]:.9g} s: {lost} "
            f"sample{'s' if lost > 1 else ''} of {dt:.6g} s {'are' if lost > 1 else 'is'} lost; "
            "cut the record there and give the parts as separate files, or write "
            '"clock": "as recorded" in bench.json'
        )
    raise CaseError(
        f"{where(k)}: `t` steps by {intervals[k - 1]:.6g} s where {dt:.4g} s is usual: the clock "
        'is irregular; write "clock": "as recorded" in bench.json, or t with more decimals'
    )


def _check_wander(t: FloatArray, rounding: float, where: Callable[[int], str]) -> None:
    slope = _slope(t)
    stray = np.abs(t - uniform(t, slope))
    k = int(stray.argmax())
    if stray[k] > WANDER * slope + 0.6 * rounding:
        raise CaseError(
            f"{where(k)}: `t` = {t[k]:.9g} s is {stray[k]:.3g} s off a uniform clock of "
            f"{slope:.6g} s: the clock drifts; write "
            '"clock": "as recorded" in bench.json'
        )


#: Steps longer than this many usual ones, and than this time [s], are gaps, and all longer than so
#: many: over a shorter one an input that is held is known well enough. A controller's command
#: changes little within three samples, and at a fast clock within a few milliseconds: position and
#: pressures answer it within tens of them.
GAP, GAP_TIME, GAP_MOST = 3.5, 5e-3, 10.5


def split_rows(t: FloatArray) -> list[slice]:
    """Return the rows of each stretch between gaps of a clock that is taken as recorded.

    Examples
    --------
    >>> split_rows(np.array([0.0, 0.1, 0.21, 0.3, 1.3, 1.4]))
    [slice(0, 4, None), slice(4, 6, None)]
    """
    intervals = np.diff(t)
    usual = float(np.median(intervals))
    longest = max(GAP * usual, min(GAP_TIME, GAP_MOST * usual))
    edges = [0, *(np.flatnonzero(intervals > longest) + 1).tolist(), t.size]
    return [slice(first, last) for first, last in pairwise(edges)]


def _slope(t: FloatArray) -> float:
    k = np.arange(t.size) - (t.size - 1) / 2
    return float(k @ (t - t.mean()) / (k @ k))


def uniform(t: FloatArray, dt: float) -> FloatArray:
    """Return the uniform clock of sample time `dt` [s] that lies closest to the stamps `t`.

    Examples
    --------
    >>> float(uniform(np.arange(7) * 0.1, 0.1)[0])
    0.0
    """
    middle = (t.size - 1) / 2
    stamps: FloatArray = t.mean() + dt * (np.arange(t.size) - middle)
    # Zero within the rounding of the mean is zero: it is printed, and names windows.
    stamps[np.abs(stamps) < 1e-9 * dt] = 0.0
    return stamps


def steps_by(t: FloatArray, dt: float) -> bool:
    """Return whether time stamps [s] are those of the uniform clock of a stated `dt` [s].

    Besides a thousandth of a step their own resolution counts, a quarter of a microsecond for
    seconds since 1970: once in the stamps, and up to thrice in the mean and sums of the clock.
    """
    resolution = float(np.spacing(np.abs(t).max()))
    return float(np.abs(t - uniform(t, dt)).max()) <= 1e-3 * dt + 4 * resolution
