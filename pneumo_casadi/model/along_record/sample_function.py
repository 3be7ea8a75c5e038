"""Functions of one sample, evaluated along a record in machine code.

CasADi's own maps over some ten thousand samples take as long to be made as to be run, and hold the
interpreter meanwhile. Here one small loop calls the generated code of a function for sample after
sample, on the arrays as they lie in memory, and other threads run beside it.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.along_record.record_function import RecordFunction, without_repetition
from pneumo_casadi.model.machine_code.calls import call_with_arrays
from pneumo_casadi.model.machine_code.compilation import build_library, compiler, generate_code
from pneumo_casadi.parameters import FloatArray

#: Calls f for N samples; every input and output moves on by so many values from one to the next.
_LOOP = """
typedef int (*sample_function)(const double**, double**, long long*, double*, int);

int evaluate_samples(sample_function f, int memory, long long N, long long n_in, long long n_out,
          const double* const* in, const long long* in_step,
          double* const* out, const long long* out_step,
          const double** arg, double** res, long long* iw, double* w) {
  for (long long k = 0; k < N; ++k) {
    for (long long i = 0; i < n_in; ++i) arg[i] = in[i] + k * in_step[i];
    for (long long i = 0; i < n_out; ++i) res[i] = out[i] + k * out_step[i];
    if (f(arg, res, iw, w, memory)) return 1;
  }
  return 0;
}
"""


@dataclass(frozen=True, eq=False)
class SampleFunction(RecordFunction):
    """A function of columns, evaluated for the samples of a record.

    Parameters
    ----------
    function : casadi.Function
        With dense inputs and outputs.
    library : path or None
        Shared library with its machine code; None to run it interpreted.
    """

    library: Path | None

    def _evaluate(self, N: int, given: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
        sizes = self._sizes_out
        if self.library is None:
            whole = [self._for_all(i, a, N) for i, a in enumerate(given)]
            results = call_with_arrays(self.function.map(N), *whole)
            return tuple(a.reshape(n, N, order="F") for n, a in zip(sizes, results, strict=True))
        outputs = [np.empty((n, N), order="F") for n in sizes]
        self._run(N, given, [(a, n) for n, a in zip(sizes, outputs, strict=True)])
        return tuple(outputs)

    def accumulate(self, N: int, *given: FloatArray) -> FloatArray:
        """Evaluate N samples of a recursion: the first input is what the last sample gave.

        Parameters
        ----------
        N : int
            Number of samples.
        given : array
            As for `evaluate`; the first one is the start (n,).

        Returns
        -------
        (n, N + 1) array
            The start, and what every sample gave.
        """
        self.check(N, given)
        n = self._sizes_out[0]
        if self.library is None:
            whole = [self._for_all(i, a, N) for i, a in enumerate(given) if i]
            (after,) = call_with_arrays(self.function.mapaccum("all", N), given[0], *whole)
            return np.asfortranarray(np.column_stack([given[0], after]))
        states = np.empty((n, N + 1), order="F")
        states[:, 0] = given[0]
        self._run(N, (states, *given[1:]), [(states[:, 1:], n)])
        return states

    def _run(
        self, N: int, given: Sequence[FloatArray], outputs: Sequence[tuple[FloatArray, int]]
    ) -> None:
        inputs = [np.asarray(a, dtype=float, order="F") for a in given]
        code = self._code
        tables = (
            np.array([a.ctypes.data for a in inputs], dtype=np.intp),
            np.array([a.shape[0] if a.ndim == 2 else 0 for a in inputs], dtype=np.int64),
            np.array([a.ctypes.data for a, _ in outputs], dtype=np.intp),
            np.array([n for _, n in outputs], dtype=np.int64),
            *(np.zeros(size, kind) for size, kind in code.work),
        )
        memory = code.checkout()
        try:
            counts = (ctypes.c_longlong(n) for n in (N, len(inputs), len(outputs)))
            failed = _loop()(code.entry, memory, *counts, *(pointer_to(a) for a in tables))
        finally:
            code.release(memory)
        if failed:
            raise ModelError(f"{self.function.name()} cannot be evaluated")

    def _for_all(self, i: int, given: FloatArray, N: int) -> FloatArray:
        """Return an input for all N samples, whatever its shape is, as CasADi's maps take it."""
        columns = given[:, :N] if given.ndim == 2 else np.tile(given[:, None], N)
        rows = self.function.size1_in(i)
        return np.asarray(columns).reshape((rows, -1), order="F")

    @cached_property
    def _sizes_out(self) -> tuple[int, ...]:
        return tuple(self.function.numel_out(i) for i in range(self.function.n_out()))

    @cached_property
    def _code(self) -> "_Code":
        return _Code(str(self.library), self.function.name())


class _Code:
    """Machine code of one function: its entry, work arrays and memory, by CasADi's C interface."""

    def __init__(self, library: str, name: str) -> None:
        self._library = ctypes.CDLL(library)
        self.entry = ctypes.cast(getattr(self._library, name), ctypes.c_void_p)
        self.checkout = getattr(self._library, f"{name}_checkout")
        self.release = getattr(self._library, f"{name}_release")
        getattr(self._library, f"{name}_incref")()
        sizes = [ctypes.c_longlong() for _ in range(4)]
        getattr(self._library, f"{name}_work")(*(ctypes.byref(size) for size in sizes))
        kinds = (np.intp, np.intp, np.int64, np.float64)
        self.work = tuple((max(1, n.value), kind) for n, kind in zip(sizes, kinds, strict=True))


def compile_sample_functions(functions: Sequence[ca.Function]) -> tuple[SampleFunction, ...]:
    """Return functions to be evaluated along records, compiled where that is possible.

    Parameters
    ----------
    functions : sequence of casadi.Function
        With different names, dense inputs and outputs.

    Examples
    --------
    >>> x, h = ca.SX.sym("x"), ca.SX.sym("h")
    >>> (decay,) = compile_sample_functions([ca.Function("decay", [x, h], [x - h * x])])
    >>> decay.accumulate(3, np.ones(1), np.array([0.5]))
    array([[1.   , 0.5  , 0.25 , 0.125]])
    >>> decay.evaluate(2, np.array([[1.0, 2.0]]), np.array([0.5]))[0]
    array([[0.5, 1. ]])
    """
    lean = [without_repetition(f) for f in functions]
    library = build_library(generate_code(lean)) if compiler() and _loop() else None
    return tuple(SampleFunction(f, library) for f in lean)


@cache
def _loop() -> Any:
    """Return the loop over samples, or None where it cannot be compiled."""
    path = build_library(_LOOP)
    return None if path is None else ctypes.CDLL(str(path)).evaluate_samples


def pointer_to(a: np.ndarray[Any, Any]) -> ctypes.c_void_p:
    """Return the address of an array, as C takes it."""
    return ctypes.c_void_p(a.ctypes.data)
