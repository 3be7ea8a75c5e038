"""Functions of one sample, evaluated for all samples at once, operation by operation.

Machine code that knows all operations works through those of a function, on blocks of samples: see
`BlockProgram`. Where there is none NumPy does, in nearly twice the time. Nothing is compiled for a
function: a diagnosis tries dozens of models, most of them for some ten evaluations.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import casadi as ca
import numpy as np

from pneumo_casadi.model.along_record.block_program import (
    BlockProgram,
    block_program,
    work_through,
)
from pneumo_casadi.model.along_record.record_function import RecordFunction, without_repetition
from pneumo_casadi.model.machine_code.operations import (
    Line,
    Program,
    consists_of,
    once_and_repeated,
    program_of,
)
from pneumo_casadi.parameters import FloatArray

#: Samples that NumPy works on at once: their arrays stay in the processor's cache.
NUMPY_BLOCK = 4096

Operation = Callable[..., Any]


def _if_else_zero(condition: Any, value: Any, out: FloatArray | None = None) -> Any:
    chosen = np.where(condition != 0, value, 0.0)
    if out is None:
        return chosen
    out[...] = chosen
    return out


def _twice(value: Any, out: FloatArray | None = None) -> Any:
    return np.multiply(value, 2.0, out=out)


def _sign(value: Any, out: FloatArray | None = None) -> Any:
    """Return the sign, that of zero as it is: CasADi keeps it, and an arc tangent tells it."""
    return np.copysign(np.sign(value), value, out=out)


#: What CasADi's operations on SX are in NumPy.
_OPERATIONS: dict[int, Operation] = {
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_NEG: np.negative,
    ca.OP_EXP: np.exp,
    ca.OP_LOG: np.log,
    ca.OP_POW: np.power,
    ca.OP_CONSTPOW: np.power,
    ca.OP_SQRT: np.sqrt,
    ca.OP_SQ: np.square,
    ca.OP_TWICE: _twice,
    ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos,
    ca.OP_TAN: np.tan,
    ca.OP_ASIN: np.arcsin,
    ca.OP_ACOS: np.arccos,
    ca.OP_ATAN: np.arctan,
    ca.OP_ATAN2: np.arctan2,
    ca.OP_SINH: np.sinh,
    ca.OP_COSH: np.cosh,
    ca.OP_TANH: np.tanh,
    ca.OP_FLOOR: np.floor,
    ca.OP_CEIL: np.ceil,
    ca.OP_FABS: np.fabs,
    ca.OP_SIGN: _sign,
    ca.OP_INV: np.reciprocal,
    ca.OP_FMIN: np.fmin,
    ca.OP_FMAX: np.fmax,
    ca.OP_LT: np.less,
    ca.OP_LE: np.less_equal,
    ca.OP_EQ: np.equal,
    ca.OP_NE: np.not_equal,
    ca.OP_NOT: np.logical_not,
    ca.OP_AND: np.logical_and,
    ca.OP_OR: np.logical_or,
    ca.OP_IF_ELSE_ZERO: _if_else_zero,
    ca.OP_LOG1P: np.log1p,
    ca.OP_EXPM1: np.expm1,
    ca.OP_HYPOT: np.hypot,
}


@dataclass(frozen=True, slots=True)
class _Plan:
    """Which lines are done once, which for every block, and where their results are kept.

    Parameters
    ----------
    once, repeated : tuple of Line
        Operations on numbers that all samples share, and on arrays.
    buffer : tuple of int
        Array that each repeated line writes to; arrays no longer needed are used again.
    blocks : BlockProgram
        The repeated lines as data for machine code.
    """

    once: tuple[Line, ...]
    repeated: tuple[Line, ...]
    buffer: tuple[int, ...]
    blocks: BlockProgram


@dataclass(frozen=True, eq=False)
class ArrayFunction(RecordFunction):
    """A function of columns, evaluated for all samples of a record.

    Parameters
    ----------
    function : casadi.Function
        Made of SX, with dense inputs and outputs.

    Examples
    --------
    >>> x, h = ca.SX.sym("x"), ca.SX.sym("h")
    >>> decay = ArrayFunction(ca.Function("decay", [x, h], [x - h * x, 2 * h]))
    >>> decay.evaluate(2, np.array([[1.0, 2.0]]), np.array([0.5]))
    (array([[0.5, 1. ]]), array([[1., 1.]]))
    """

    @staticmethod
    def suits(function: ca.Function) -> bool:
        """Tell whether a function is made of operations that are known here."""
        return consists_of(function, frozenset(_OPERATIONS))

    def _evaluate(self, N: int, given: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
        f, program = self.function, self._program
        shared = tuple(a.ndim == 1 for a in given)
        plan = self._plans(shared)
        rows = [np.ascontiguousarray(a, dtype=float) for a in given]
        outputs = tuple(np.zeros((f.numel_out(i), N)) for i in range(f.n_out()))
        values: list[Any] = [0.0] * program.size
        for value, number in program.constants:
            values[value] = number
        moving = {}
        for value, i, row in program.inputs:
            if shared[i]:
                values[value] = float(rows[i][row])
            else:
                moving[value] = rows[i][row]
        with np.errstate(all="ignore"):  # as machine code: what is no number shows in the result
            for line in plan.once:
                operation = _OPERATIONS[line.operation]
                values[line.result] = float(operation(*(values[k] for k in line.given)))
        results = [outputs[i][row] for i, row, _ in program.outputs]
        if work_through() is not None:
            plan.blocks.run(N, values, moving, results)
        else:
            self._by_numpy(plan, N, values, moving, results)
        return outputs

    def _by_numpy(
        self,
        plan: _Plan,
        N: int,
        values: list[Any],
        moving: Mapping[int, FloatArray],
        results: Sequence[FloatArray],
    ) -> None:
        buffers = np.empty((plan.blocks.arrays, min(N, NUMPY_BLOCK)))
        for first in range(0, N, NUMPY_BLOCK):
            n = min(NUMPY_BLOCK, N - first)
            for value, row in moving.items():
                values[value] = row[first : first + n]
            with np.errstate(all="ignore"):
                self._run(plan, values, list(buffers[:, :n]))
            for result, (_, _, value) in zip(results, self._program.outputs, strict=True):
                result[first : first + n] = values[value]

    def _run(self, plan: _Plan, values: list[Any], arrays: Sequence[FloatArray]) -> None:
        for line, buffer in zip(plan.repeated, plan.buffer, strict=True):
            operands = (values[k] for k in line.given)
            _OPERATIONS[line.operation](*operands, out=arrays[buffer])
            values[line.result] = arrays[buffer]

    @cached_property
    def _program(self) -> Program:
        return program_of(without_repetition(self.function))

    @cached_property
    def _plans(self) -> Callable[[tuple[bool, ...]], _Plan]:
        program = self._program
        return cache(lambda shared: _plan(program, shared))


def _plan(program: Program, shared: Sequence[bool]) -> _Plan:
    """Return the plan of a program of which some inputs are shared by all samples."""
    moving = tuple(value for value, i, _ in program.inputs if not shared[i])
    once, repeated = once_and_repeated(program, moving)
    last = {value: k for k, line in enumerate(repeated) for value in line.given}
    last |= {value: len(repeated) for _, _, value in program.outputs}
    free: list[int] = []
    held: dict[int, int] = {}
    buffer: list[int] = []
    for k, line in enumerate(repeated):
        held[line.result] = free.pop() if free else len(held)
        buffer.append(held[line.result])
        ending = {*line.given, line.result}
        free += [held.pop(v) for v in sorted(ending) if v in held and last.get(v, k) <= k]
    blocks = block_program(program, repeated, buffer, moving)
    return _Plan(once, repeated, tuple(buffer), blocks)
