"""Compilation of the bench's kernels by numba, cached by content.

Numba's own cache looks only at the file of the compiled function, so that a change in a kernel
that is called from another file would go unnoticed; here the folder carries a hash of all of
them. It lies in the user's cache, so the package may be read-only.
"""

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

from pneumo_casadi.errors import MissingExtraError
from pneumo_casadi.runtime.cache import FOLDER, authentication_code, cache_folder

try:
    import numba
except ImportError as error:
    raise MissingExtraError(
        "the virtual bench runs compiled and needs numba, which is not installed: "
        "pip install 'pneumo-casadi[bench]'"
    ) from error

logger = logging.getLogger(__name__)

Kernel = TypeVar("Kernel", bound=Callable[..., Any])


def kernel(function: Kernel) -> Kernel:
    """Compile a function that other kernels call; it is compiled into them.

    Python cannot call it: wrappers for that would take a sixth of the time of compiling.
    """
    return _compiled(function, no_cpython_wrapper=True, no_cfunc_wrapper=True)


def entry(function: Kernel) -> Kernel:
    """Compile a function that Python calls, and keep the machine code for the next process."""
    folder = kernel_cache()
    if folder is None:
        return _compiled(function)
    config: Any = numba.config
    before = config.CACHE_DIR
    try:
        config.CACHE_DIR = str(folder)  # read when the function is declared
        return _compiled(function, cache=True)
    except RuntimeError as error:  # numba found no place that can be written
        logger.warning("kernels are not cached: %s", error)
        return _compiled(function)
    finally:
        config.CACHE_DIR = before


def _compiled(function: Kernel, **options: Any) -> Kernel:
    return cast(Kernel, numba.njit(error_model="numpy", **options)(function))


def kernel_cache() -> Path | None:
    """Return the folder of the compiled kernels, None where none is this user's alone."""
    sources = sorted(Path(__file__).parent.rglob("*.py"))
    # Numba runs what it finds: the folder has a name that only this user's key makes.
    key = authentication_code(b"\0".join(path.read_bytes() for path in sources)).hex()
    try:
        return cache_folder(f"bench-{key[:16]}")
    except OSError as error:
        logger.warning("kernels are not cached (%s); set %s to a folder of yours", error, FOLDER)
        return None
