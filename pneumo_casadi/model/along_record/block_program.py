"""Programs of operations as data for machine code that works through blocks of samples."""

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.model.along_record.sample_function import pointer_to
from pneumo_casadi.model.machine_code.block_code import BLOCK, block_code
from pneumo_casadi.model.machine_code.compilation import build_library
from pneumo_casadi.model.machine_code.operations import Line, Program
from pneumo_casadi.parameters import FloatArray


@dataclass(frozen=True, eq=False)
class BlockProgram:
    """What is done for every sample, on slots; see `block_code`.

    Parameters
    ----------
    lines : (n, 4) array of int
        Operation, slot of the result, slots of what it takes.
    arrays : int
        How many slots are arrays of one block.
    shared, moving : tuple of int
        Values of the program in the slots of numbers, and in those of rows.
    sources : array of int
        Slots of the outputs, in the program's order.
    """

    lines: NDArray[np.int32]
    arrays: int
    shared: tuple[int, ...]
    moving: tuple[int, ...]
    sources: NDArray[np.int32]

    def run(
        self,
        N: int,
        numbers: Sequence[float],
        rows: Mapping[int, FloatArray],
        outputs: Sequence[FloatArray],
    ) -> None:
        """Work through N samples.

        Parameters
        ----------
        numbers : sequence of float
            Of all values of the program; those that move may be any.
        rows : mapping of int to (N,) array
            What moving values are, each contiguous.
        outputs : sequence of (N,) array
            Where the results go, each contiguous.
        """
        shared = np.array([numbers[value] for value in self.shared], dtype=float)
        memory = np.empty((self.arrays, BLOCK))
        copies = np.zeros((len(self.moving), BLOCK))
        slots = np.array(
            [
                *(memory.ctypes.data + memory.strides[0] * np.arange(self.arrays)),
                *(shared.ctypes.data + shared.itemsize * np.arange(len(shared))),
                *(rows[value].ctypes.data for value in self.moving),
            ],
            dtype=np.intp,
        )
        places = np.array([output.ctypes.data for output in outputs], dtype=np.intp)
        work_through()(
            *(ctypes.c_longlong(n) for n in (N, len(self.lines))),
            pointer_to(self.lines),
            *(ctypes.c_longlong(n) for n in (self.arrays, len(self.shared), len(self.moving))),
            pointer_to(slots),
            pointer_to(copies),
            ctypes.c_longlong(len(outputs)),
            pointer_to(self.sources),
            pointer_to(places),
        )


@cache
def work_through() -> Any:
    """Return the machine code, or None where it cannot be compiled."""
    library = build_library(block_code())
    return None if library is None else ctypes.CDLL(str(library)).work_through


def block_program(
    program: Program, repeated: Sequence[Line], buffer: Sequence[int], moving: Sequence[int]
) -> BlockProgram:
    """Return a program as data.

    Parameters
    ----------
    program : Program
        Whose inputs and outputs count.
    repeated : sequence of Line
        What is done for every sample.
    buffer : sequence of int
        Array that each of these lines writes to.
    moving : sequence of int
        Values among the inputs that change from sample to sample.
    """
    arrays = max(buffer, default=-1) + 1
    results = {line.result for line in repeated}
    taken = {value for line in repeated for value in line.given}
    taken |= {value for _, _, value in program.outputs}
    shared = sorted(taken - results - set(moving))
    slot = {value: arrays + k for k, value in enumerate((*shared, *moving))}
    lines = []
    for line, array in zip(repeated, buffer, strict=True):
        first, last = (slot[line.given[k]] for k in (0, -1))  # of one operand both are it
        slot[line.result] = array
        lines.append((line.operation, array, first, last))
    return BlockProgram(
        np.array(lines, dtype=np.int32).reshape(-1, 4),
        arrays,
        tuple(shared),
        tuple(moving),
        np.array([slot[value] for _, _, value in program.outputs], dtype=np.int32),
    )
