"""Shares with intervals, and how far stated probabilities are off."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

#: Bins of the calibration, of equal numbers of cases.
BINS = 10


@dataclass(frozen=True, slots=True)
class Share:
    """So many of so many, with Wilson's interval (95 %).

    Parameters
    ----------
    hits, of : int
        Counts.

    Examples
    --------
    >>> Share(8, 10).as_dict()["percent"]
    80.0
    >>> [round(100 * end, 1) for end in Share(8, 10).interval]
    [49.0, 94.3]
    """

    hits: int
    of: int

    @staticmethod
    def among(answers: Iterable[bool]) -> "Share":
        """Count the right among some answers."""
        given = [bool(answer) for answer in answers]
        return Share(sum(given), len(given))

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the interval [1]; everything where nothing was counted."""
        if self.of == 0:
            return 0.0, 1.0
        interval = stats.binomtest(self.hits, self.of).proportion_ci(method="wilson")
        return float(interval.low), float(interval.high)

    def as_dict(self) -> dict[str, Any]:
        """Return counts, percentage (None of nothing) and interval [%]."""
        low, high = self.interval
        return {
            "hits": self.hits,
            "of": self.of,
            "percent": 100.0 * self.hits / self.of if self.of else None,
            "interval": [100.0 * low, 100.0 * high],
        }


@dataclass(frozen=True, slots=True)
class Bin:
    """Cases of neighbouring stated probability.

    Parameters
    ----------
    stated : float
        Mean stated probability.
    share : Share
        Those that were right.
    each : tuple of float
        Every stated probability.
    """

    stated: float
    share: Share
    each: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Calibration:
    """Stated probabilities beside how often they came true.

    Parameters
    ----------
    bins : tuple of Bin
        By rising probability, of equal numbers.
    error : float or None
        Expected calibration error: the mean of ``|stated − true|`` over the bins, weighted by their
        cases; None without cases.
    """

    bins: tuple[Bin, ...]
    error: float | None

    @property
    def error_if_exact(self) -> float | None:
        """Mean error that as many cases would show if all stated probabilities were exact.

        Each bin counts the hits of its own probabilities. An error as small says that they may be
        exact.

        Examples
        --------
        >>> calibration([0.5] * 100, [True, False] * 50, bins=1).error_if_exact
        0.0398
        """
        cases = sum(bin_.share.of for bin_ in self.bins)
        if not cases:
            return None
        off = 0.0
        for bin_ in self.bins:
            chance = np.ones(1)  # of each number of hits
            for p in bin_.each:
                chance = np.convolve(chance, (1 - p, p))
            hits = np.arange(chance.size)
            off += float(chance @ np.abs(hits - bin_.share.of * bin_.stated))
        return round(off / cases, 4)

    def as_dict(self) -> dict[str, Any]:
        """Return bins and error as plain data."""
        return {
            "expected_calibration_error": self.error,
            "error_if_exact": self.error_if_exact,
            "bins": [{"stated": bin_.stated, **bin_.share.as_dict()} for bin_ in self.bins],
        }


def calibration(stated: Sequence[float], right: Sequence[bool], bins: int = BINS) -> Calibration:
    """Set stated probabilities beside what came true.

    Parameters
    ----------
    stated : sequence of float
        Probabilities [1].
    right : sequence of bool
        Whether each came true.
    bins : int, optional
        Number of bins, of equal numbers of statements.

    Examples
    --------
    >>> calibration([0.2, 0.2, 0.8, 0.8], [False, False, True, True], bins=2).error
    0.2
    """
    order = np.argsort(np.asarray(stated, dtype=float), kind="stable")
    parts = [part for part in np.array_split(order, bins) if part.size]
    made = tuple(
        Bin(
            float(np.mean([stated[i] for i in part])),
            Share.among(right[i] for i in part),
            tuple(float(stated[i]) for i in part),
        )
        for part in parts
    )
    if not made:
        return Calibration((), None)
    off = [abs(bin_.stated - bin_.share.hits / bin_.share.of) * bin_.share.of for bin_ in made]
    return Calibration(made, round(float(sum(off)) / len(stated), 12))
