"""Functions made of SX, as operations on numbered values."""

from collections.abc import Iterable
from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True, slots=True)
class Line:
    """One operation: ``values[result] = operation(values[given] ...)``.

    Parameters
    ----------
    operation : int
        CasADi's number of it, such as ``casadi.OP_ADD``.
    given : tuple of int
        Values that it takes.
    result : int
        Value that it gives.
    """

    operation: int
    given: tuple[int, ...]
    result: int


@dataclass(frozen=True, slots=True)
class Program:
    """A function as operations on numbered values, each value given once.

    Parameters
    ----------
    inputs : tuple of (int, int, int)
        Value, input and row.
    constants : tuple of (int, float)
        Value and number.
    lines : tuple of Line
        In order.
    outputs : tuple of (int, int, int)
        Output, row and value.
    size : int
        Number of values.
    """

    inputs: tuple[tuple[int, int, int], ...]
    constants: tuple[tuple[int, float], ...]
    lines: tuple[Line, ...]
    outputs: tuple[tuple[int, int, int], ...]
    size: int


def program_of(function: ca.Function) -> Program:
    """Return the operations of a function made of SX, every result a value of its own.

    Examples
    --------
    >>> x = ca.SX.sym("x")
    >>> program = program_of(ca.Function("square", [x], [x * x + 0.5]))
    >>> [line.operation for line in program.lines] == [ca.OP_SQ, ca.OP_ADD]
    True
    >>> len(program.inputs), len(program.constants), len(program.outputs)
    (1, 1, 1)
    """
    held: dict[int, int] = {}  # value in each of CasADi's registers, which are used again
    inputs, constants, lines, outputs = [], [], [], []
    for k in range(function.n_instructions()):
        operation, given = function.instruction_id(k), function.instruction_input(k)
        result = function.instruction_output(k)
        if operation == ca.OP_OUTPUT:
            outputs.append((result[0], result[1], held[given[0]]))
            continue
        if operation == ca.OP_INPUT:
            inputs.append((k, given[0], given[1]))
        elif operation == ca.OP_CONST:
            constants.append((k, function.instruction_constant(k)))
        else:
            lines.append(Line(operation, tuple(held[register] for register in given), k))
        held[result[0]] = k
    size = function.n_instructions()
    return Program(tuple(inputs), tuple(constants), tuple(lines), tuple(outputs), size)


def once_and_repeated(
    program: Program, moving: Iterable[int]
) -> tuple[tuple[Line, ...], tuple[Line, ...]]:
    """Return the lines that are done once for all samples, and those that are for each.

    Parameters
    ----------
    moving : iterable of int
        Values among the inputs that change from sample to sample.
    """
    changing, once, repeated = set(moving), [], []
    for line in program.lines:
        if changing.isdisjoint(line.given):
            once.append(line)
        else:
            changing.add(line.result)
            repeated.append(line)
    return tuple(once), tuple(repeated)


def consists_of(function: ca.Function, operations: frozenset[int]) -> bool:
    """Tell whether a function is made of SX, and of these operations alone."""
    if not function.is_a("SXFunction"):
        return False
    known = operations | {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST}
    return all(function.instruction_id(k) in known for k in range(function.n_instructions()))
