"""C code of a recursion that runs several variants side by side.

A processor works on four numbers as fast as on one. Here each number of a function of SX is a
vector of one number a variant: variants of a model, with other parameters, are simulated together.
Sums, products, quotients and roots then cost hardly more than those of one; exponentials and the
like are computed one after another. What no sample changes is computed before the first.
"""

from collections.abc import Sequence
from math import isfinite, isnan

import casadi as ca

from pneumo_casadi.model.machine_code.operations import (
    Line,
    consists_of,
    once_and_repeated,
    program_of,
)

#: Variants side by side: what fits into a register of most processors.
LANES = 4

_OPERATORS = {
    ca.OP_ADD: "{a} + {b}",
    ca.OP_SUB: "{a} - {b}",
    ca.OP_MUL: "{a} * {b}",
    ca.OP_DIV: "{a} / {b}",
    ca.OP_NEG: "-{a}",
    ca.OP_SQ: "{a} * {a}",
    ca.OP_TWICE: "{a} + {a}",
    ca.OP_INV: "one / {a}",
    ca.OP_FABS: "CHOSEN(~SIGN, {a})",
    ca.OP_SIGN: "EITHER({a} > zero, one, EITHER({a} < zero, -one, {a}))",
    ca.OP_FMIN: "EITHER(({a} < {b}) | ({b} != {b}), {a}, {b})",  # where one is no number, the other
    ca.OP_FMAX: "EITHER(({a} > {b}) | ({b} != {b}), {a}, {b})",
    ca.OP_LT: "CHOSEN({a} < {b}, one)",
    ca.OP_LE: "CHOSEN({a} <= {b}, one)",
    ca.OP_EQ: "CHOSEN({a} == {b}, one)",
    ca.OP_NE: "CHOSEN({a} != {b}, one)",
    ca.OP_NOT: "CHOSEN({a} == zero, one)",
    ca.OP_AND: "CHOSEN(({a} != zero) & ({b} != zero), one)",
    ca.OP_OR: "CHOSEN(({a} != zero) | ({b} != zero), one)",
    ca.OP_IF_ELSE_ZERO: "CHOSEN({a} != zero, {b})",
}
#: C's functions that processors have for several numbers at once, and those that they have not.
_AT_ONCE = {
    ca.OP_SQRT: "sqrt({a})",
    ca.OP_FLOOR: "floor({a})",
    ca.OP_CEIL: "ceil({a})",
}
_ONE_BY_ONE = {
    ca.OP_EXP: "exp({a})",
    ca.OP_LOG: "log({a})",
    ca.OP_POW: "pow({a}, {b})",
    ca.OP_CONSTPOW: "pow({a}, {b})",
    ca.OP_SIN: "sin({a})",
    ca.OP_COS: "cos({a})",
    ca.OP_TAN: "tan({a})",
    ca.OP_ASIN: "asin({a})",
    ca.OP_ACOS: "acos({a})",
    ca.OP_ATAN: "atan({a})",
    ca.OP_ATAN2: "atan2({a}, {b})",
    ca.OP_TANH: "tanh({a})",
    ca.OP_SINH: "sinh({a})",
    ca.OP_COSH: "cosh({a})",
    ca.OP_LOG1P: "log1p({a})",
    ca.OP_EXPM1: "expm1({a})",
    ca.OP_HYPOT: "hypot({a}, {b})",
}
_TEMPLATES = {**_OPERATORS, **_AT_ONCE, **_ONE_BY_ONE}
#: What can be written here.
OPERATIONS = frozenset(_TEMPLATES)

#: Vectors of numbers, and what statements on them are written with.
VECTORS = f"""\
#define LANES {LANES}
#define EACH for (int i = 0; i < LANES; ++i)
typedef double numbers __attribute__((vector_size(8 * LANES)));
typedef long long bits __attribute__((vector_size(8 * LANES)));
#define SIGN ((bits)(-zero))
#define CHOSEN(mask, a) ((numbers)((bits)(a) & (mask)))
#define EITHER(mask, a, b) ((numbers)(((bits)(a) & (mask)) | ((bits)(b) & ~(mask))))
"""

_CODE = """\
#include <math.h>
{vectors}
#define USED for (int i = 0; i < used; ++i)

void recur(long long N, long long used, const double* const* in, const long long* in_step,
           double* const* out) {{
  const numbers zero = {{0}}, one = zero + 1.0;
  numbers z[{size}] = {{{{0}}}};
  USED for (int k = 0; k < {size}; ++k) z[k][i] = out[i][k];
{before}
  for (long long n = 0; n < N; ++n) {{
{each}
    USED for (int k = 0; k < {size}; ++k) out[i][(n + 1) * {size} + k] = z[k][i];
  }}
}}
"""


def runs_in_lanes(function: ca.Function) -> bool:
    """Tell whether a function is made of operations that are known here."""
    return consists_of(function, OPERATIONS)


def recursion_code(function: ca.Function, moving: Sequence[bool]) -> str:
    """Return C code that calls a function for sample after sample.

    Parameters
    ----------
    function : casadi.Function
        Made of SX, of one output: what the first input is for the next sample.
    moving : sequence of bool
        Whether an input may change from sample to sample, for each after the first.

    Returns
    -------
    str
        Of ``recur(N, used, in, in_step, out)``: N samples; how many variants there are, at most
        `LANES`; the inputs of `LANES` variants, those of the first input before those of the
        second; how many numbers each moves on by from sample to sample; and for every variant
        where its results go, the start first.
    """
    program = program_of(function)
    changes = (True, *moving)
    moving_values = (value for value, i, _ in program.inputs if changes[i])
    once, repeated = once_and_repeated(program, moving_values)
    before, each = [], []
    for value, number in program.constants:
        before.append(f"  const numbers v{value} = {_literal(number)} - zero;")
    for value, i, row in program.inputs:
        if i == 0:
            each.append(f"    const numbers v{value} = z[{row}];")
            continue
        at = f"n * in_step[{i}] + {row}" if changes[i] else str(row)
        read = f"  numbers v{value}; EACH v{value}[i] = in[{i} * LANES + i][{at}];"
        (each if changes[i] else before).append(read)
    before += [f"  {_declared(line)}" for line in once]
    each += [f"    {_declared(line)}" for line in repeated]
    # All states were read above, so that none is overwritten before it is used.
    each += [f"    z[{row}] = v{value};" for _, row, value in program.outputs]
    size = function.numel_in(0)
    return _CODE.format(vectors=VECTORS, size=size, before="\n".join(before), each="\n".join(each))


def statement(operation: int, result: str, a: str, b: str) -> str:
    """Return C code that sets a vector, of which it assumes that it holds zeros.

    Parameters
    ----------
    operation : int
        CasADi's number of it.
    result, a, b : str
        Names of vectors; of one operand `b` may be any.
    """
    if operation in _OPERATORS:
        return f"{result} = {_OPERATORS[operation].format(a=a, b=b)};"
    lanes = "EACH" if operation in _AT_ONCE else "USED"
    return f"{lanes} {result}[i] = {expression(operation, f'{a}[i]', f'{b}[i]')};"


def expression(operation: int, a: str, b: str) -> str:
    """Return C code of an operation on two numbers; unless it `is_call`, vectors will do too."""
    return _TEMPLATES[operation].format(a=a, b=b)


def is_call(operation: int) -> bool:
    """Tell whether an operation is a function of C, for which processors have no instruction."""
    return operation in _ONE_BY_ONE


def takes_one(operation: int) -> bool:
    """Tell whether an operation has one operand."""
    return "{b}" not in _TEMPLATES[operation]


def _declared(line: Line) -> str:
    a, b = (f"v{line.given[k]}" for k in (0, -1))  # of one operand both are it
    result = f"v{line.result}"
    code = statement(line.operation, result, a, b)
    return (
        f"const numbers {code}"
        if line.operation in _OPERATORS
        else f"numbers {result} = zero; {code}"
    )


def _literal(number: float) -> str:
    """Return a constant as CasADi would write it, so that it is told from the instructions."""
    if not isfinite(number):
        return "NAN" if isnan(number) else "INFINITY" if number > 0 else "-INFINITY"
    return f"({number:.1f})" if number == int(number) and abs(number) < 100 else f"({number:.16e})"
