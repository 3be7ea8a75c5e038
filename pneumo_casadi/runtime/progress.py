"""Progress reports of long computations."""

from collections.abc import Callable

#: Called with a text that names the current task, and the share of the work done, 0 to 1.
Progress = Callable[[str, float], None]


def no_progress(text: str, share: float) -> None:
    """Ignore a progress report."""


def progress_range(report: Progress, first: float, last: float, prefix: str = "") -> Progress:
    """Return a `Progress` for a part of the work, from `first` to `last`; it prefixes its texts.

    Examples
    --------
    >>> progress_range(lambda text, share: print(text, share), 0.5, 1.0)("fitting", 0.5)
    fitting 0.75
    """
    return lambda text, share: report(prefix + text, first + (last - first) * share)
