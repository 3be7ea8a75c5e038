"""How long work tells what it is doing."""

from collections.abc import Callable

#: Called with what is being done and the share of the work done so far.
Progress = Callable[[str, float], None]


def no_progress(text: str, share: float) -> None:
    """Tell nobody."""


def progress_range(report: Progress, first: float, last: float, prefix: str = "") -> Progress:
    """Return what reports the progress of a part of the work, with a text before each of its own.

    Examples
    --------
    >>> progress_range(lambda text, share: print(text, share), 0.5, 1.0)("fitting", 0.5)
    fitting 0.75
    """
    return lambda text, share: report(prefix + text, first + (last - first) * share)
