"""Recursions over the samples of a record, several variants side by side in machine code."""

import ctypes
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from pneumo_casadi.model.along_record.record_function import without_repetition
from pneumo_casadi.model.along_record.sample_function import (
    SampleFunction,
    compile_sample_functions,
    pointer_to,
)
from pneumo_casadi.model.machine_code.calls import THREADS
from pneumo_casadi.model.machine_code.compilation import build_library
from pneumo_casadi.model.machine_code.lane_code import LANES, recursion_code, runs_in_lanes
from pneumo_casadi.parameters import FloatArray

#: The inputs of a function along a record, one array each.
Inputs = Sequence[FloatArray]


@dataclass(frozen=True, eq=False)
class Recursion:
    """A function whose first input is what it gave for the last sample.

    Parameters
    ----------
    sample : SampleFunction
        The function; it is run by itself where there is no code for variants side by side.
    moving : sequence of bool
        Whether an input may change from sample to sample, for each after the first.
    recur : callable, optional
        That code, as `recursion_code` writes it.
    """

    sample: SampleFunction
    moving: Sequence[bool]
    recur: Any = None

    def accumulate(self, N: int, variants: Sequence[Inputs]) -> list[FloatArray]:
        """Run N samples of each variant.

        Parameters
        ----------
        N : int
            Number of samples.
        variants : sequence of sequence of array
            The inputs of each: first the start (n,), then (n, N), or (n,) where all samples have
            the same.

        Returns
        -------
        list of (n, N + 1) array
            The start, and what every sample gave.

        Raises
        ------
        ValueError
            If an input has another shape, or changes from sample to sample in some variants only.
        """
        if not variants:
            return []
        for given in variants:
            self._check(N, given)
        if len({tuple(a.ndim for a in given) for given in variants}) > 1:
            raise ValueError("an input changes from sample to sample in some variants only")
        width = LANES if self.recur is not None else 1
        groups = [variants[k : k + width] for k in range(0, len(variants), width)]
        run: Callable[[Sequence[Inputs]], list[FloatArray]] = partial(
            self._side_by_side if self.recur is not None else self._alone, N
        )
        if len(groups) == 1:
            return run(groups[0])
        # Machine code runs without the interpreter, so that threads run beside each other.
        with ThreadPoolExecutor(min(THREADS, len(groups))) as pool:
            return [states for group in pool.map(run, groups) for states in group]

    def _check(self, N: int, given: Inputs) -> None:
        if len(given) != 1 + len(self.moving):
            raise ValueError(f"{len(given)} inputs, expected {1 + len(self.moving)}")
        self.sample.check(N, given)
        for i, (a, may_move) in enumerate(zip(given, (False, *self.moving), strict=True)):
            if a.ndim == 2 and not may_move:
                raise ValueError(f"input {i} changes from sample to sample, which it must not")

    def _alone(self, N: int, variants: Sequence[Inputs]) -> list[FloatArray]:
        return [self.sample.accumulate(N, *given) for given in variants]

    def _side_by_side(self, N: int, variants: Sequence[Inputs]) -> list[FloatArray]:
        arrays = [[np.asarray(a, dtype=float, order="F") for a in given] for given in variants]
        results = [np.empty((len(given[0]), N + 1), order="F") for given in arrays]
        for states, given in zip(results, arrays, strict=True):
            states[:, 0] = given[0]
        sizes = [0 if a.ndim == 1 else len(a) for a in arrays[0]]
        # Lanes without a variant of their own read the inputs of the last one.
        lanes = [min(lane, len(variants) - 1) for lane in range(LANES)]
        tables = (
            np.array([arrays[k][i].ctypes.data for i in range(len(sizes)) for k in lanes], np.intp),
            np.array(sizes, np.int64),
            np.array([states.ctypes.data for states in results], np.intp),
        )
        counts = (ctypes.c_longlong(n) for n in (N, len(variants)))
        self.recur(*counts, *(pointer_to(a) for a in tables))
        return results


def compile_recursion(function: ca.Function, moving: Sequence[bool]) -> Recursion:
    """Return a function to be run from sample to sample, compiled where that is possible.

    Parameters
    ----------
    function : casadi.Function
        With dense inputs and one dense output, of the size of its first input.
    moving : sequence of bool
        Whether an input may change from sample to sample, for each after the first.

    Raises
    ------
    ValueError
        If the function is of another form.

    Examples
    --------
    >>> x, h = ca.SX.sym("x"), ca.SX.sym("h")
    >>> decay = compile_recursion(ca.Function("decay", [x, h], [x - h * x]), (False,))
    >>> slow, fast = decay.accumulate(3, [(np.ones(1), np.array([h])) for h in (0.5, 0.25)])
    >>> slow
    array([[1.   , 0.5  , 0.25 , 0.125]])
    >>> fast
    array([[1.      , 0.75    , 0.5625  , 0.421875]])
    """
    dense = [function.sparsity_in(i).is_dense() for i in range(function.n_in())]
    one_result = function.n_out() == 1 and function.sparsity_out(0) == function.sparsity_in(0)
    if not all(dense) or not one_result or len(moving) != function.n_in() - 1:
        raise ValueError(f"{function.name()}: its one output must be dense, as its first input is")
    lean = without_repetition(function)
    if runs_in_lanes(lean):
        library = build_library(recursion_code(lean, moving))
        if library is not None:
            return Recursion(SampleFunction(lean, None), moving, ctypes.CDLL(str(library)).recur)
    (sample,) = compile_sample_functions([function])
    return Recursion(sample, moving)
