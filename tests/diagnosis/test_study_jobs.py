"""A study goes to other processes once."""

import gc
import hashlib
import operator
import os
import pickle
import sys
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from multiprocessing import get_context

import pytest

from pneumo_casadi.diagnosis.prepare import study_jobs
from pneumo_casadi.diagnosis.prepare.study_jobs import PackedStudy, StudyJobs
from pneumo_casadi.errors import FitError
from pneumo_casadi.runtime.processes import worker_pool

#: What is sent here in place of a study, large enough to be seen in a message.
STUDY = {"axis": "a" * 100_000}


def length(study, add):
    return len(study["axis"]) + add


def fail(study):
    raise FitError("no fit")


class Elsewhere(Executor):
    """An executor of which nothing is known: its processes may be on another machine."""

    def submit(self, fn, /, *given):
        self.sent = pickle.dumps((fn, given))
        job, arguments = pickle.loads(self.sent)
        done = Future()
        done.set_result(job(*arguments))
        return done


@pytest.fixture(autouse=True)
def _nothing_unpacked():
    study_jobs._unpacked.cache_clear()


def test_without_an_executor_a_job_is_done_at_once():
    jobs = StudyJobs(STUDY, None)
    assert jobs.run(length, 1).result() == 100_001
    with pytest.raises(FitError, match="no fit"):
        jobs.run(fail).result()


def test_where_nothing_is_known_of_the_machine_the_study_goes_along():
    executor = Elsewhere()
    assert StudyJobs(STUDY, executor).run(length, 2).result() == 100_002
    assert len(executor.sent) > 100_000


@pytest.mark.parametrize("own", [True, False], ids=["own pool", "of Python"])
def test_processes_of_this_machine_get_no_copy_with_each_job(own):
    pool = worker_pool(1) if own else ProcessPoolExecutor(1, get_context("spawn"))
    with pool as executor:
        jobs = StudyJobs(STUDY, executor)
        if sys.platform == "linux":
            assert len(pickle.dumps(jobs._packed)) < 1000
        # A function that another process can import: tests are no module there.
        results = [jobs.run(operator.contains, name) for name in ("axis", "record", "axis")]
        assert [each.result() for each in results] == [True, False, True]


@pytest.mark.skipif(sys.platform != "linux", reason="files without a name are known to Linux")
def test_the_file_is_gone_with_its_owner():
    executor = ProcessPoolExecutor(1)
    jobs = StudyJobs(STUDY, executor)
    path = jobs._packed.content
    assert pickle.loads(path.read_bytes()) == STUDY
    del jobs
    assert not path.exists()


class Waiting(Executor):
    """An executor whose jobs wait until `work` is called."""

    def __init__(self):
        self.waiting = []

    def submit(self, fn, /, *given):
        future = Future()
        self.waiting.append((future, fn, given))
        return future

    def work(self):
        future, fn, given = self.waiting.pop()
        future.set_result(fn(*given))
        return future


@pytest.mark.skipif(sys.platform != "linux", reason="files without a name are known to Linux")
def test_the_file_stays_until_the_last_job_is_done(monkeypatch):
    monkeypatch.setattr(study_jobs, "runs_here", lambda executor: True)
    executor = Waiting()
    StudyJobs(STUDY, executor).run(length, 1)  # whose owner is gone at once
    _, _, (packed, *_) = executor.waiting[0]
    assert executor.work().result() == 100_001
    gc.collect()
    assert not packed.content.exists()


def test_another_study_under_the_same_name_is_refused(tmp_path):
    path = tmp_path / "study"
    path.write_bytes(pickle.dumps({"axis": "b"}))
    with pytest.raises(OSError, match="there is another one"):
        study_jobs._unpacked(PackedStudy("of the first", path))


def test_where_there_is_no_such_file_the_study_goes_along(monkeypatch):
    def full(name):
        raise OSError("no space")

    monkeypatch.setattr(os, "memfd_create", full, raising=False)
    jobs = StudyJobs(STUDY, ProcessPoolExecutor(1))
    assert pickle.loads(jobs._packed.content) == STUDY


def test_a_process_unpacks_a_study_once():
    content = pickle.dumps(STUDY)
    token = hashlib.sha256(content).hexdigest()
    first = study_jobs._unpacked(PackedStudy(token, content))
    assert study_jobs._unpacked(PackedStudy(token, b"never read")) is first
