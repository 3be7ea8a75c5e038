"""Jobs on one study, done in other processes where there is an executor."""

import hashlib
import os
import pickle
import weakref
from collections.abc import Callable
from concurrent.futures import Executor, Future
from contextlib import suppress
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
    """A study on its way to another process.

    Parameters
    ----------
    token : str
        By which a process knows that it has unpacked the study before.
    packed : bytes
        The study, if it goes along with every job.
    path : Path or None
        What holds it otherwise.
    """

    token: str
    packed: bytes = field(default=b"", compare=False)
    path: Path | None = field(default=None, compare=False)


class StudyJobs:
    """Call functions of one study, which is packed once for all of them.

    Where the system allows it, processes on this machine read it from the memory of this one, once
    each: a minute at 5 kHz takes 30 MB, and a diagnosis has more than a hundred jobs.

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
        token = hashlib.sha256(packed).hexdigest()
        self._packed = PackedStudy(token, packed)
        if runs_here(executor):
            with suppress(AttributeError, OSError):  # known to Linux; elsewhere it goes along
                self._packed = PackedStudy(token, path=self._shown(packed))

    def _shown(self, packed: bytes) -> Path:
        """Return a file without a name that holds the study as long as this object is there."""
        handle = os.memfd_create("study")
        weakref.finalize(self, os.close, handle)
        with os.fdopen(handle, "wb", closefd=False) as file:
            file.write(packed)
        return Path(f"/proc/{os.getpid()}/fd/{handle}")

    def run(self, job: Callable[..., object], *given: object) -> "Future[Any]":
        """Have the executor call ``job(study, *given)``; without one it is done at once."""
        if self.executor is not None:
            return self.executor.submit(_run_in_worker, self._packed, job, *given)
        done: Future[Any] = Future()
        try:
            done.set_result(job(self.study, *given))
        except FAULTS as error:
            done.set_exception(error)
        return done


@one_thread
def _run_in_worker(packed: PackedStudy, job: Callable[..., object], *given: object) -> object:
    return job(_unpacked(packed), *given)


@lru_cache(maxsize=2)
def _unpacked(packed: PackedStudy) -> Study:
    content = packed.packed if packed.path is None else packed.path.read_bytes()
    study: Study = pickle.loads(content)
    return study
