"""Jobs on one study, done in other processes where there is an executor."""

import hashlib
import pickle
from collections.abc import Callable
from concurrent.futures import Executor, Future
from functools import lru_cache
from typing import Any

from pneumo_casadi.diagnosis.prepare.fitted_model import FAULTS
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.runtime.threads import one_thread


class StudyJobs:
    """Call functions of one study, which is packed once for all of them.

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
        self._packed = pickle.dumps(study) if executor is not None else b""

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
def _run_in_worker(packed: bytes, job: Callable[..., object], *given: object) -> object:
    return job(_unpickled(hashlib.sha256(packed).hexdigest(), packed), *given)


@lru_cache(maxsize=2)
def _unpickled(token: str, packed: bytes) -> Study:
    del token
    study: Study = pickle.loads(packed)
    return study
