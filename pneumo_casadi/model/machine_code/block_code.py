"""C code that works through operations on blocks of samples, whichever operations they are.

A program of operations is data to it: one library serves all functions, so that nothing has to be
compiled for a model. Operations on blocks that stay in the processor's cache cost no call of the
interpreter each.
"""

from functools import cache

from pneumo_casadi.model.machine_code.lane_code import (
    OPERATIONS,
    VECTORS,
    expression,
    is_call,
    statement,
    takes_one,
)

#: Samples that are worked on at once.
BLOCK = 256

_CODE = """\
#pragma GCC optimize ("O3") /* compiled once, whatever models are compiled with */
/* glibc has some functions for several numbers at once, and tells those who allow fast maths. */
#define __FAST_MATH__ 1
#include <math.h>
#undef __FAST_MATH__
#include <string.h>
{vectors}
typedef double loose __attribute__((vector_size(8 * LANES), aligned(8), may_alias));
#define BLOCK {block}
#define AT(p) (*(const loose *)((p) + k))
#define VECTORS for (int k = 0; k < BLOCK; k += LANES)
#define SET(statement) numbers r = zero; statement *(loose *)(o + k) = r
#define ONE(statement) VECTORS {{ const numbers x = AT(a); SET(statement); }} break;
/* Less a zero a number keeps its sign, even that of zero. */
#define TWO(statement) \\
  if (a_shared) {{ \\
    const numbers x = *a - zero; VECTORS {{ const numbers y = AT(b); SET(statement); }} \\
  }} else if (b_shared) {{ \\
    const numbers y = *b - zero; VECTORS {{ const numbers x = AT(a); SET(statement); }} \\
  }} else VECTORS {{ const numbers x = AT(a), y = AT(b); SET(statement); }} \\
  break;
#define SAMPLES for (int k = 0; k < BLOCK; ++k)
#define CALL_ONE(value) SAMPLES {{ const double x = a[k]; o[k] = value; }} break;
#define CALL_TWO(value) \\
  if (a_shared) {{ \\
    const double x = *a; SAMPLES {{ const double y = b[k]; o[k] = value; }} \\
  }} else if (b_shared) {{ \\
    const double y = *b; SAMPLES {{ const double x = a[k]; o[k] = value; }} \\
  }} else SAMPLES {{ const double x = a[k], y = b[k]; o[k] = value; }} \\
  break;

static void apply(int operation, const double *a, int a_shared, const double *b, int b_shared,
                  double *restrict o) {{
  const numbers zero = {{0}}, one = zero + 1.0;
  (void)one;
  switch (operation) {{
{cases}
  }}
}}

/* Slots hold what lines take and give: first arrays of BLOCK samples, then numbers that all samples
   share, then rows of N samples, whose slots are moved on from block to block. A line is an
   operation, the slot of its result, and two more. Blocks are worked on whole, so that no sample
   depends on where it stands: the last one is that of copies, filled up with zeros. */
void work_through(long long N, long long lines, const int *line, long long arrays, long long shared,
                  long long rows, double **slot, double *copies, long long outputs,
                  const int *source, double *const *out) {{
  const long long moving = arrays + shared, slots = moving + rows;
  for (long long first = 0; first < N; first += BLOCK) {{
    const long long n = N - first < BLOCK ? N - first : BLOCK;
    if (n < BLOCK)
      for (long long k = moving; k < slots; ++k) {{
        double *copy = copies + (k - moving) * BLOCK;
        memcpy(copy, slot[k], n * sizeof(double));
        slot[k] = copy;
      }}
    for (const int *at = line; at < line + 4 * lines; at += 4)
      apply(at[0], slot[at[2]], at[2] >= arrays && at[2] < moving, slot[at[3]],
            at[3] >= arrays && at[3] < moving, slot[at[1]]);
    for (long long k = 0; k < outputs; ++k) {{
      const int from = source[k];
      double *to = out[k] + first;
      if (from >= arrays && from < moving)
        for (long long i = 0; i < n; ++i) to[i] = *slot[from];
      else
        memcpy(to, slot[from], n * sizeof(double));
    }}
    for (long long k = moving; k < slots; ++k) slot[k] += BLOCK;
  }}
}}
"""


@cache
def block_code() -> str:
    """Return C code of ``work_through``.

    Of N samples it takes the number of lines and the lines; how many slots are arrays of `BLOCK`
    samples, numbers and rows, and where each is; zeros for a block of all rows; and how many
    results there are, in which slot each is, and where it goes.
    """
    cases = []
    for operation in sorted(OPERATIONS):
        kind = "ONE" if takes_one(operation) else "TWO"
        call = is_call(operation)
        code = expression(operation, "x", "y") if call else statement(operation, "r", "x", "y")
        cases.append(f"    case {operation}: {'CALL_' if call else ''}{kind}({code})")
    return _CODE.format(vectors=VECTORS, block=BLOCK, cases="\n".join(cases))
