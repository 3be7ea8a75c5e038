"""Worker processes for independent fits."""

import os
import signal
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context

#: Environment variables that limit the threads of linear algebra; read when a process begins.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@contextmanager
def processes(workers: int) -> Iterator[Executor | None]:
    """Yield an executor of so many processes, None for one: then all is done in this process."""
    if workers == 1:
        yield None
        return
    # A forked process would inherit the threads of compiled models in whatever state they are.
    context = get_context("spawn")
    executor = ProcessPoolExecutor(workers, context, initializer=ignore_interrupts)
    # Processes share the cores; linear algebra that uses all of them in each slows every fit.
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update({name: "1" for name, value in before.items() if value is None})
    try:
        yield executor
    finally:
        executor.shutdown(cancel_futures=True)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)


def ignore_interrupts() -> None:
    """Leave Ctrl-C to the parent: fits that have begun end, and are kept; no other begins."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
