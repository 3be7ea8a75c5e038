"""CasADi functions of foreign files, looked through in a process of its own.

Reading a file of functions can load a plug-in: its name stands in the file, and CasADi looks for it
in the current folder too. The process runs in an empty folder, so that there is none to be loaded,
and refuses what does not consist of known operations. Run as a script, without the rest of the
package: standard input holds a JSON list of serialized functions.
"""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

#: Classes of functions that are expressions and nothing else.
CLASSES = ("SXFunction", "MXFunction")
#: Operations beyond arithmetic: inputs, constants, parts of matrices, splines; no calls.
_STRUCTURE = (
    *("INPUT", "OUTPUT", "CONST", "PARAMETER", "BSPLINE"),
    *("MTIMES", "DOT", "TRANSPOSE", "RESHAPE", "SPARSITY_CAST", "PROJECT", "DENSIFY", "SPARSIFY"),
    *("HORZCAT", "VERTCAT", "DIAGCAT", "HORZSPLIT", "VERTSPLIT", "DIAGSPLIT", "HORZREPMAT"),
    *("HORZREPSUM", "SUBREF", "SUBASSIGN", "GETNONZEROS", "ADDNONZEROS", "SETNONZEROS"),
    *("GETNONZEROS_PARAM", "NORM1", "NORM2", "NORMINF", "NORMF", "MMIN", "MMAX", "BILIN", "RANK1"),
)
_ARITHMETIC = (
    *("ASSIGN", "ADD", "SUB", "MUL", "DIV", "NEG", "EXP", "LOG", "POW", "CONSTPOW", "SQRT", "SQ"),
    *("TWICE", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "ATAN2", "SINH", "COSH", "TANH"),
    *("ASINH", "ACOSH", "ATANH", "LT", "LE", "EQ", "NE", "NOT", "AND", "OR", "FLOOR", "CEIL"),
    *("FMOD", "REMAINDER", "FABS", "SIGN", "COPYSIGN", "IF_ELSE_ZERO", "ERF", "ERFINV", "FMIN"),
    *("FMAX", "INV", "LOG1P", "EXPM1", "HYPOT", "LIFT"),
)
#: Time for the check [s]: reading takes a second, and a large model some more.
TIME = 60.0


def refusal(functions: Sequence[str]) -> str:
    """Return why one of some serialized functions is not read, or an empty text.

    Parameters
    ----------
    functions : sequence of str
        As CasADi writes them.
    """
    from pneumo_casadi.runtime.atomic_files import draft_folder
    from pneumo_casadi.runtime.children import last_line, run_child

    with draft_folder() as empty:
        try:
            done = run_child(
                [sys.executable, "-P", str(Path(__file__))],
                json.dumps(list(functions)).encode(),
                TIME,
                empty,
                {name: value for name, value in os.environ.items() if name != "CASADIPATH"},
            )
        except subprocess.TimeoutExpired:
            return f"it is not read within {TIME:g} s"
    if done.returncode == 0:
        return ""
    return last_line(done.stderr)


def main() -> None:
    """Look through the functions on standard input."""
    import casadi as ca

    for text in json.loads(sys.stdin.buffer.read()):
        _check(ca, ca.StringDeserializer(text).unpack())


def _check(ca: Any, f: Any) -> None:
    if not isinstance(f, ca.Function) or f.class_name() not in CLASSES:
        raise ValueError("something else than expressions")
    known = {getattr(ca, f"OP_{name}", None) for name in (*_STRUCTURE, *_ARITHMETIC)}
    for k in range(f.n_instructions()):
        operation = f.instruction_id(k)
        if operation not in known:
            raise ValueError(f"operation {operation} of {f.name()} is none of those known")


if __name__ == "__main__":
    main()
