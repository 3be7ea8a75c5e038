"""Worker processes for independent fits.

A worker ends with its parent, whatever ends that. One that dies costs its task only.
"""

import os
import pickle
import queue
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from importlib import import_module
from multiprocessing import get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any

from pneumo_casadi.errors import PneumoError
from pneumo_casadi.runtime.interruption import ENDING, at_hard_end, interruptible

#: Environment variables that limit the threads of linear algebra; read when a process begins.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
#: What reads them.
LINEAR_ALGEBRA = ("numpy", "scipy.linalg")
#: More processes than this do not help a command: each of its stages waits for its last task.
MOST_WORKERS = 4
#: How often a task is begun: the first worker may have died of what others did to the machine.
TRIES = 2
#: Time for the orderly end of a worker, and for it to be gone before it is killed [s].
GRACE, GONE = 0.4, 0.7


class WorkerDiedError(PneumoError):
    """The process of a task died again and again: killed, out of memory, or crashed."""


def default_workers() -> int:
    """Return how many processes a command begins if nobody says how many."""
    return min(os.cpu_count() or 1, MOST_WORKERS)


@contextmanager
def processes(workers: int, imports: Sequence[str] = ()) -> Iterator[Executor | None]:
    """Yield an executor of so many processes, None for one: then all is done in this process."""
    if workers == 1:
        yield None
        return
    with worker_pool(workers, imports) as pool:
        yield pool


@contextmanager
def worker_pool(workers: int, imports: Sequence[str] = ()) -> Iterator[Executor]:
    """Yield an executor of so many processes; an exception in the block ends them at once.

    A task whose process dies is begun once more; then its future has a `WorkerDiedError`, and the
    other tasks go on. Modules that tasks will need are imported before the first one comes.
    """
    # Processes share the cores; linear algebra that uses all of them in each slows every fit. That
    # of this process is loaded before the limit, which is for the workers.
    for name in LINEAR_ALGEBRA:
        import_module(name)
    if os.name == "posix":  # in the main thread: it unblocks signals, which workers begin with
        resource_tracker.ensure_running()
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update({name: "1" for name, value in before.items() if value is None})
    pool = _WorkerPool(workers, imports)
    try:
        with at_hard_end(pool.stop):
            yield pool
            pool.shutdown(cancel_futures=True)
    finally:
        pool.stop()
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)


def runs_here(executor: Executor) -> bool:
    """Tell whether tasks run in processes of this machine, which can read its files."""
    return isinstance(executor, (ProcessPoolExecutor, _WorkerPool))


class _WorkerPool(Executor):
    """Threads that each have a process, and give it one task at a time."""

    def __init__(self, workers: int, imports: Sequence[str] = ()) -> None:
        self._imports = tuple(imports)
        self._tasks: queue.SimpleQueue[tuple[Future[Any], bytes] | None] = queue.SimpleQueue()
        self._workers: set[_Worker] = set()
        self._closed = False
        self._end = threading.Event()
        self._threads = [threading.Thread(target=self._serve, daemon=True) for _ in range(workers)]
        for thread in self._threads:
            thread.start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        if self._closed:
            raise RuntimeError("the pool of processes was closed")
        future: Future[Any] = Future()
        try:
            self._tasks.put((future, pickle.dumps((fn, args, kwargs))))
        except Exception as error:
            future.set_exception(error)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._closed = True
        if cancel_futures:
            with suppress(queue.Empty):
                while item := self._tasks.get_nowait():
                    item[0].cancel()
        for _ in self._threads:
            self._tasks.put(None)
        if wait:
            for thread in self._threads:
                thread.join()

    def stop(self) -> None:
        """End the workers, whatever they are at."""
        self._end.set()
        self.shutdown(wait=False, cancel_futures=True)
        workers = list(self._workers)
        for worker in workers:
            worker.process.terminate()
        deadline = time.monotonic() + GONE
        for worker in workers:
            worker.process.join(max(deadline - time.monotonic(), 0.0))
            worker.process.kill()

    def _serve(self) -> None:
        """Have tasks done by one worker, or by its successors; runs in a thread."""
        if hasattr(signal, "pthread_sigmask"):  # workers begin with this mask
            signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
        worker: _Worker | None = None
        if self._imports:  # which take a while: not when the first task comes
            with suppress(OSError):
                worker = self._started()
        while (item := self._tasks.get()) is not None:
            future, task = item
            if not future.set_running_or_notify_cancel():
                continue
            done, result = False, None
            for _ in range(TRIES):
                try:
                    worker = worker or self._started()
                    done, result = worker.run(task)
                    break
                except (EOFError, OSError) as error:
                    result = _died(error if worker is None else self._ended(worker))
                    worker = None
            (future.set_result if done else future.set_exception)(result)
        if worker is not None:
            self._ended(worker)

    def _started(self) -> "_Worker":
        if self._end.is_set():
            raise OSError("the pool was stopped")
        worker = _Worker(self._imports)
        self._workers.add(worker)
        if self._end.is_set():  # `stop` may not have seen this one
            worker.process.kill()
        return worker

    def _ended(self, worker: "_Worker") -> str:
        """Wait for the end of a worker and say how it came."""
        worker.connection.close()
        worker.process.join()
        self._workers.discard(worker)
        code = worker.process.exitcode or 0
        return f"signal {-code}" if code < 0 else f"exit code {code}"


def _died(reason: object) -> WorkerDiedError:
    return WorkerDiedError(
        f"the process of a task died {TRIES} times ({reason}): killed, or crashed, perhaps for "
        "want of memory; run it again, with fewer workers"
    )


class _Worker:
    """A process that waits for tasks."""

    def __init__(self, imports: Sequence[str]) -> None:
        # A forked process would inherit the threads of compiled models in whatever state they are.
        context = get_context("spawn")
        self.connection, other = context.Pipe()
        self.process = context.Process(target=_work, args=(other, imports))
        try:
            self.process.start()
        finally:
            other.close()

    def run(self, task: bytes) -> tuple[bool, Any]:
        """Have a task done; return whether it was, and its result or its exception."""
        self.connection.send_bytes(task)
        answer = self.connection.recv_bytes()
        try:
            done, result = pickle.loads(answer)
        except Exception as error:  # a class of its own that cannot be made anew
            return False, error
        return done, result


def _work(connection: "Connection[Any, Any]", imports: Sequence[str]) -> None:
    """Do tasks until the parent wants no more, or is gone."""
    for number in ENDING:
        if number != signal.SIGTERM:  # Ctrl-C comes to all processes of a terminal; the parent
            signal.signal(number, signal.SIG_IGN)  # knows what to do
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
    for name in imports:  # a signal ends the process at once: there is nothing to tidy up yet
        with suppress(Exception):  # a task that needs it says why it cannot be imported
            import_module(name)
    with suppress(KeyboardInterrupt, EOFError, OSError), interruptible(GRACE) as interruption:
        interruption.explained = True  # by the parent
        while True:
            task = connection.recv_bytes()
            try:
                fn, args, kwargs = pickle.loads(task)
                answer = pickle.dumps((True, fn(*args, **kwargs)))
            except BaseException as error:
                if interruption.number:
                    return
                answer = _packed_error(error)
            connection.send_bytes(answer)


def _packed_error(error: BaseException) -> bytes:
    error.add_note(traceback.format_exc())  # the traceback itself cannot be sent
    try:
        return pickle.dumps((False, error))
    except Exception:
        return pickle.dumps((False, PneumoError(f"{type(error).__name__}: {error}")))


def _end_with_parent() -> None:
    parent = parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os.kill(os.getpid(), signal.SIGTERM)
