"""Jobs on one study, done in other processes where there is an executor."""

import hashlib
import os
import pickle
import weakref
from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from pneumo_casadi.diagnosis.prepare.fitted_model import FAULTS
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.runtime.processes import runs_here
from pneumo_casadi.runtime.threads import one_thread


@dataclass(frozen=True, slots=True)
class PackedStudy:
    """A study on its way to another process; two are equal if their studies are.

    Parameters
    ----------
    token : str
        Hash of the packed study, by which a process knows that it has unpacked it before.
    content : bytes or Path
        The packed study itself, or the file that holds it.
    """

    token: str
    content: bytes | Path = field(compare=False)


class StudyJobs:
    """Call functions of one study, which is packed once for all of them.

    On Linux, processes of this machine read it from the memory of this one, once each; elsewhere it
    goes along with every job: a minute at 5 kHz takes 30 MB, and there are more than a hundred.

    Parameters
    ----------
    study : Study
        The case.
    executor : Executor or None
        Where they run; None for this process.
    """

    def __init__(self, study: Study, executor: Executor | None) -> None:
        self.study = study
        self.executor = executor
        if executor is None:
            return
        packed = pickle.dumps(study)
        shown = self._show(packed) if runs_here(executor) else None
        self._packed = PackedStudy(hashlib.sha256(packed).hexdigest(), shown or packed)

    def _show(self, packed: bytes) -> Path | None:
        """Return a file in memory that is there as long as this object; None where that cannot be.

        It has no name that could be left behind.
        """
        try:
            handle = os.memfd_create("study")
            weakref.finalize(self, os.close, handle)
            with os.fdopen(handle, "wb", closefd=False) as file:
                file.write(packed)
        except (AttributeError, OSError):
            return None
        path = Path(f"/proc/{os.getpid()}/fd/{handle}")
        return path if path.exists() else None

    def run(self, job: Callable[..., object], *given: object) -> "Future[Any]":
        """Have the executor call ``job(study, *given)``; without one it is done at once."""
        if self.executor is not None:
            future = self.executor.submit(_run_in_worker, self._packed, job, *given)
            if isinstance(self._packed.content, Path):  # is there as long as this object
                future.add_done_callback(self._is_done)
            return future
        done: Future[Any] = Future()
        try:
            done.set_result(job(self.study, *given))
        except FAULTS as error:
            done.set_exception(error)
        return done

    def _is_done(self, future: "Future[Any]") -> None:
        """Do nothing; a job that waits for its turn holds this method."""


@one_thread
def _run_in_worker(packed: PackedStudy, job: Callable[..., object], *given: object) -> object:
    return job(_unpacked(packed), *given)


@lru_cache(maxsize=2)
def _unpacked(packed: PackedStudy) -> Study:
    content = packed.content
    known = content.read_bytes() if isinstance(content, Path) else content
    if hashlib.sha256(known).hexdigest() != packed.token:
        raise OSError("a job came too late: where its study was, there is another one")
    study: Study = pickle.loads(known)
    return study
