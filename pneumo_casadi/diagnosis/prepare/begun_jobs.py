"""Jobs begun while processes wait, before anybody has asked for them."""

from collections.abc import Hashable
from concurrent.futures import Future
from typing import Any


class BegunJobs:
    """Jobs by what they work on; whoever asks for one takes it.

    Examples
    --------
    >>> begun = BegunJobs()
    >>> begun.add("hose", 1.0, Future())
    >>> begun.take("hose", 2.0) is None  # it was begun with something else
    True
    """

    def __init__(self) -> None:
        self._jobs: dict[Hashable, tuple[object, Future[Any]]] = {}

    def __contains__(self, key: Hashable) -> bool:
        return key in self._jobs

    def add(self, key: Hashable, given: object, job: "Future[Any]") -> None:
        """Remember a job and what it was given; one begun before it in its place is cancelled."""
        self._cancel(key)
        self._jobs[key] = given, job

    def take(self, key: Hashable, given: object) -> "Future[Any] | None":
        """Return the job that was given the same, None where there is none; it is gone then."""
        before, job = self._jobs.pop(key, (None, None))
        if job is not None and before != given:
            job.cancel()
            return None
        return job

    def cancel_all(self) -> None:
        """Cancel the jobs for which nobody has asked; one that runs goes on to its end."""
        for key in list(self._jobs):
            self._cancel(key)

    def _cancel(self, key: Hashable) -> None:
        _, job = self._jobs.pop(key, (None, None))
        if job is not None:
            job.cancel()
