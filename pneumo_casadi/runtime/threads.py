"""Number of threads of the linear algebra: a single one is fastest for many small products."""

import sys
from collections.abc import Callable
from functools import lru_cache, wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
T = TypeVar("T")


def one_thread(work: Callable[P, T]) -> Callable[P, T]:
    """Run a function with one thread of linear algebra.

    More of them wait for each other longer than they compute, the more so where processes share
    the machine: a job of 22 s was seen to take 96 s on two busy cores. The caller's setting comes
    back.

    Examples
    --------
    >>> from threadpoolctl import threadpool_info
    >>> @one_thread
    ... def threads():
    ...     return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}
    >>> threads()
    {1}
    """

    @wraps(work)
    def alone(*args: P.args, **kwargs: P.kwargs) -> T:
        with _libraries(len(sys.modules)).limit(limits=1, user_api="blas"):
            return work(*args, **kwargs)

    return alone


@lru_cache(maxsize=1)
def _libraries(modules: int) -> ThreadpoolController:
    """Return the libraries that are loaded, looked for anew when more modules are imported.

    All files that the process has mapped are gone through, which takes as long as a short fit.
    """
    return ThreadpoolController()
