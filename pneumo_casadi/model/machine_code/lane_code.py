"""C code of a recursion that runs several variants side by side.

A processor works on four numbers as fast as on one. Here each number of a function of SX is a
vector of one number a variant: variants of a model, with other parameters, are simulated together,
at less than half of the price of each alone. What no sample changes is computed before the first.
"""

from collections.abc import Sequence
from math import isfinite, isnan

import casadi as ca

from pneumo_casadi.model.machine_code.operations import Line, Program, consists_of, program_of

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
    ca.OP_FMIN: "EITHER({a} < {b}, {a}, {b})",
    ca.OP_FMAX: "EITHER({a} > {b}, {a}, {b})",
    ca.OP_LT: "CHOSEN({a} < {b}, one)",
    ca.OP_LE: "CHOSEN({a} <= {b}, one)",
    ca.OP_EQ: "CHOSEN({a} == {b}, one)",
    ca.OP_NE: "CHOSEN({a} != {b}, one)",
    ca.OP_NOT: "CHOSEN({a} == zero, one)",
    ca.OP_AND: "CHOSEN(({a} != zero) & ({b} != zero), one)",
    ca.OP_OR: "CHOSEN(({a} != zero) | ({b} != zero), one)",
    ca.OP_IF_ELSE_ZERO: "CHOSEN({a} != zero, {b})",
}
#: Of C's own functions, which take one number after another.
_FUNCTIONS = {
    ca.OP_SQRT: "sqrt({a}[l])",
    ca.OP_EXP: "exp({a}[l])",
    ca.OP_LOG: "log({a}[l])",
    ca.OP_POW: "pow({a}[l], {b}[l])",
    ca.OP_CONSTPOW: "pow({a}[l], {b}[l])",
    ca.OP_SIN: "sin({a}[l])",
    ca.OP_COS: "cos({a}[l])",
    ca.OP_TAN: "tan({a}[l])",
    ca.OP_ASIN: "asin({a}[l])",
    ca.OP_ACOS: "acos({a}[l])",
    ca.OP_ATAN: "atan({a}[l])",
    ca.OP_ATAN2: "atan2({a}[l], {b}[l])",
    ca.OP_TANH: "tanh({a}[l])",
    ca.OP_SINH: "sinh({a}[l])",
    ca.OP_COSH: "cosh({a}[l])",
    ca.OP_LOG1P: "log1p({a}[l])",
    ca.OP_EXPM1: "expm1({a}[l])",
    ca.OP_HYPOT: "hypot({a}[l], {b}[l])",
    ca.OP_FLOOR: "floor({a}[l])",
    ca.OP_CEIL: "ceil({a}[l])",
}
_KNOWN = frozenset({*_OPERATORS, *_FUNCTIONS})

_CODE = """\
#include <math.h>
#define LANES {lanes}
#define EACH(l) for (int l = 0; l < LANES; ++l)
typedef double numbers __attribute__((vector_size(8 * LANES)));
typedef long long bits __attribute__((vector_size(8 * LANES)));
#define SIGN ((bits)(-zero))
#define CHOSEN(mask, a) ((numbers)((bits)(a) & (mask)))
#define EITHER(mask, a, b) ((numbers)(((bits)(a) & (mask)) | ((bits)(b) & ~(mask))))

void recur(long long N, const double* const* in, const long long* in_step, double* const* out) {{
  const numbers zero = {{0}}, one = zero + 1.0;
  numbers z[{size}];
  EACH(l) for (int i = 0; i < {size}; ++i) z[i][l] = out[l][i];
{before}
  for (long long n = 0; n < N; ++n) {{
{each}
    EACH(l) for (int i = 0; i < {size}; ++i) out[l][(n + 1) * {size} + i] = z[i][l];
  }}
}}
"""


def runs_in_lanes(function: ca.Function) -> bool:
    """Tell whether a function is made of operations that are known here."""
    return consists_of(function, _KNOWN)


def recursion_code(function: ca.Function, moving: Sequence[bool]) -> str:
    """Return C code that calls a function for sample after sample.

    Parameters
    ----------
    function : casadi.Function
        Made of SX, of one output: what the first input is for the next sample.
    moving : sequence of bool
        Whether an input changes from sample to sample, for each.

    Returns
    -------
    str
        Of ``recur(N, in, in_step, out)``: N samples; the inputs of all variants, those of the
        first input before those of the second; how many numbers each moves on by from sample to
        sample; and for every variant where its results go, the start first.
    """
    program = program_of(function)
    changing = {value for value, i, _ in program.inputs if moving[i]}
    before, each = [], []
    for value, number in program.constants:
        before.append(f"  const numbers v{value} = zero + {_literal(number)};")
    for value, i, row in program.inputs:
        if i == 0:
            each.append(f"    const numbers v{value} = z[{row}];")
            continue
        at = f"n * in_step[{i}] + {row}" if moving[i] else str(row)
        read = f"numbers v{value}; EACH(l) v{value}[l] = in[{i} * LANES + l][{at}];"
        (each if moving[i] else before).append(f"    {read}")
    for line in program.lines:
        if changing.isdisjoint(line.given):
            before.append(f"  {_statement(line)}")
        else:
            changing.add(line.result)
            each.append(f"    {_statement(line)}")
    each += _stored(program)
    size = function.numel_in(0)
    return _CODE.format(lanes=LANES, size=size, before="\n".join(before), each="\n".join(each))


def _statement(line: Line) -> str:
    a, b = (f"v{line.given[k]}" for k in (0, -1))
    if line.operation in _OPERATORS:
        expression = _OPERATORS[line.operation].format(a=a, b=b)
        return f"const numbers v{line.result} = {expression};"
    by_lane = _FUNCTIONS[line.operation].format(a=a, b=b)
    return f"numbers v{line.result}; EACH(l) v{line.result}[l] = {by_lane};"


def _stored(program: Program) -> list[str]:
    """Return how the results become the states; all are read before the first is written."""
    return [f"    z[{row}] = v{value};" for _, row, value in program.outputs]


def _literal(number: float) -> str:
    if isfinite(number):
        return f"({number!r})"
    return "NAN" if isnan(number) else "INFINITY" if number > 0 else "-INFINITY"
