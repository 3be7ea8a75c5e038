"""Calls with arrays, one or many side by side, without CasADi's matrices in between."""

import weakref
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from pneumo_casadi.parameters import FloatArray

#: Threads that share calls side by side, and how many calls one map holds.
THREADS, SIDE_BY_SIDE = 2, 128


def call_with_arrays(f: ca.Function, *given: FloatArray) -> tuple[FloatArray, ...]:
    """Call a function with arrays and return arrays.

    The conversion of CasADi's matrices would cost more than a long record's simulation.

    Parameters
    ----------
    f : casadi.Function
        With dense inputs and outputs.
    given : array
        One array per input, of its shape.

    Returns
    -------
    tuple of array
        One array per output, of its shape, in Fortran order.

    Raises
    ------
    ValueError
        If the size of an array differs from that of its input.

    Examples
    --------
    >>> x = ca.SX.sym("x", 2)
    >>> call_with_arrays(ca.Function("double", [x], [2 * x]), np.array([1.0, 2.0]))[0].ravel()
    array([2., 4.])
    """
    kept = [np.asarray(a, dtype=float).ravel("F") for a in given]
    results = [np.empty(f.nnz_out(i)) for i in range(f.n_out())]
    _call(f, kept, results)
    return tuple(a.reshape(f.size_out(i), order="F") for i, a in enumerate(results))


class ResultMemory:
    """Memory of results, which serves again once nothing refers to them any more.

    The system hands out new memory page by page, each filled with zeros. For the hundreds of
    megabytes of a linearised long record this takes a fifth of the time of its simulation.

    Examples
    --------
    >>> memory = ResultMemory()
    >>> first, second = memory.empty((2, 3)), memory.empty((2, 3))
    >>> address = first.ctypes.data
    >>> part = first[:1]
    >>> del first  # a part of it is still in use
    >>> memory.empty((2, 3)).ctypes.data == address
    False
    >>> del part
    >>> memory.empty((3, 2)).ctypes.data == address
    True
    """

    def __init__(self) -> None:
        self._free: dict[int, list[FloatArray]] = {}

    def empty(self, shape: tuple[int, int]) -> FloatArray:
        """Return an array of any content, in Fortran order."""
        size = shape[0] * shape[1]
        try:
            array = self._free.setdefault(size, []).pop()
        except IndexError:
            array = np.empty(size)
        return np.asarray(_Lease(array, self)).reshape(shape, order="F")

    def take_back(self, array: FloatArray) -> None:
        """Keep an array that nothing refers to."""
        self._free.setdefault(array.size, []).append(array)

    def release(self) -> None:
        """Give the memory that nothing uses back to the system."""
        self._free.clear()

    def __reduce__(self) -> tuple[type["ResultMemory"], tuple[()]]:
        return ResultMemory, ()  # another process has its own


class _Lease:
    """Lends an array: every view of it holds the lease, at whose end it goes back."""

    def __init__(self, array: FloatArray, memory: ResultMemory) -> None:
        self.__array_interface__ = array.__array_interface__
        # A result that outlives its problem must not keep the memory of all the others.
        returned = weakref.finalize(self, _give_back, weakref.ref(memory), array)
        returned.atexit = False  # nothing will use it


def _give_back(owner: weakref.ref[ResultMemory], array: FloatArray) -> None:
    memory = owner()
    if memory is not None:
        memory.take_back(array)


def call_side_by_side(
    f: ca.Function, *given: FloatArray, memory: ResultMemory | None = None
) -> tuple[FloatArray, ...]:
    """Call a function once for each of many column groups, which threads share.

    Parameters
    ----------
    f : casadi.Function
        With dense inputs and outputs.
    given : array
        The inputs of all calls side by side, one array per input.
    memory : ResultMemory, optional
        Where the outputs are written; by default to new arrays.

    Returns
    -------
    tuple of array
        The outputs of all calls side by side, one array per output, in Fortran order.

    Notes
    -----
    CasADi writes down every call of a map: that of a long record would take as long to make as to
    evaluate. A map of few calls is used over and over.

    Examples
    --------
    >>> x = ca.SX.sym("x", 2)
    >>> call_side_by_side(ca.Function("sum", [x], [ca.sum1(x)]), np.arange(8.0).reshape(2, 4))[0]
    array([[ 4.,  6.,  8., 10.]])
    """
    count = given[0].shape[1] // f.size2_in(0)
    kept = [np.asfortranarray(a, dtype=float) for a in given]
    memory = ResultMemory() if memory is None else memory
    results = [memory.empty((f.size1_out(i), count * f.size2_out(i))) for i in range(f.n_out())]
    for first in range(0, count, SIDE_BY_SIDE):
        n = min(SIDE_BY_SIDE, count - first)
        _call(
            _mapped_once(f, n),
            [_columns(a, first, n, f.size2_in(i)) for i, a in enumerate(kept)],
            [_columns(a, first, n, f.size2_out(i)) for i, a in enumerate(results)],
        )
    return tuple(results)


def mapped(f: ca.Function, count: int) -> ca.Function:
    """Return some calls of a function side by side, shared among threads."""
    return f.map(count, "thread", THREADS) if count > 1 else f


_mapped_once = lru_cache(maxsize=128)(mapped)


def _columns(array: FloatArray, first: int, count: int, width: int) -> FloatArray:
    """Return the values of some column groups as a view."""
    return array[:, first * width : (first + count) * width].ravel("F")


def _call(f: ca.Function, given: Sequence[FloatArray], results: Sequence[FloatArray]) -> None:
    """Call a function with flat arrays; write to the memory of `results`."""
    buffer: Any
    run: Any
    buffer, run = f.buffer()
    for i, array in enumerate(given):
        if array.size != f.nnz_in(i):
            raise ValueError(
                f"{f.name()}: input {i} has {array.size} values, expected {f.nnz_in(i)}"
            )
        buffer.set_arg(i, memoryview(array))  # type: ignore[arg-type]
    for i, array in enumerate(results):
        buffer.set_res(i, memoryview(array))  # type: ignore[arg-type]
    run()
