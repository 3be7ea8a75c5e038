"""CasADi functions as machine code: generated C, compiled once, cached by content.

Where no C compiler is found the functions are used as they are, with one notice.
"""

import ctypes
import hashlib
import hmac
import logging
import os
import platform
import shutil
import sys
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path

import casadi as ca

from pneumo_casadi.model.machine_code.code_constants import ConstantTable, separate_constants
from pneumo_casadi.runtime.atomic_files import draft_folder
from pneumo_casadi.runtime.cache import (
    FOLDER,
    LENGTH,
    authentication_code,
    cache_folder,
    is_own_file,
)
from pneumo_casadi.runtime.children import last_line, run_child

logger = logging.getLogger(__name__)

#: Compiler flags, part of the cache key. Made for this processor and without traps and error
#: numbers, sensitivities run in less than half the time; NaN and infinity stay what they are.
FAST = ("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math")
#: What every compiler understands, for those that refuse `FAST`.
PLAIN = ("-O2",)
#: Environment variable that switches compilation off ("0").
SWITCH = "PNEUMO_CASADI_COMPILE"
#: Environment variable with flags in the place of `FAST`, parted by spaces.
FLAGS = "PNEUMO_CASADI_FLAGS"
#: Systems whose libraries `ConstantTable.filled` may change.
_FILLED = ("linux", "freebsd")


@cache
def compiler() -> str | None:
    """Return the path of the C compiler, or None where there is none or it is switched off."""
    if os.environ.get(SWITCH) == "0":
        return None
    for name in (os.environ.get("CC", ""), "gcc", "cc", "clang"):
        path = shutil.which(name) if name else None
        if path:
            return path
    logger.warning(
        "no C compiler found: functions run interpreted, several times slower; "
        "install gcc or clang, or set %s=0 to silence this",
        SWITCH,
    )
    return None


def compile_functions(functions: Sequence[ca.Function]) -> tuple[ca.Function, ...]:
    """Return the functions compiled to machine code.

    Parameters
    ----------
    functions : sequence of casadi.Function
        With different names; what they call is compiled with them.

    Returns
    -------
    tuple of casadi.Function
        With the same names and signatures; the given functions themselves where compiling is
        not possible (no compiler, code that the compiler refuses, a cache that cannot be written),
        after a logged warning.

    Notes
    -----
    The library's file name is the hash of its C code, the compiler, its flags and the
    processor: a library is never used for a changed model or on another kind of machine. Models
    that differ in their constants only share what was compiled. Files are written to a temporary
    one and renamed, so that two processes may build at once. A library that is damaged or does
    not load is built again.

    Examples
    --------
    >>> import casadi as ca
    >>> x = ca.SX.sym("x")
    >>> (square,) = compile_functions([ca.Function("square", [x], [x**2])])
    >>> float(square(3))
    9.0
    """
    path = build_library(generate_code(functions))
    if path is None:
        return tuple(functions)
    return tuple(ca.external(f.name(), str(path)) for f in functions)


def build_library(code: str) -> Path | None:
    """Return the shared library made of C code, or None where that is not possible.

    It is built unless the cache holds it, and is known to load. Its instructions are compiled
    apart from its constants, see `separate_constants`.
    """
    if compiler() is None:
        return None
    instructions, table = separate_constants(code)
    for _ in range(2):
        try:
            name = f"{_key(instructions, table.code)}.so"
            path = _built(name, partial(_link, instructions, table))
            if path is None:
                return None
        except OSError as error:
            logger.warning(
                "cannot write to the cache (%s): functions run interpreted; set %s to a folder "
                "that can be written",
                error,
                FOLDER,
            )
            return None
        try:
            ctypes.CDLL(str(path))
            return path
        except OSError as error:
            logger.warning("compiled library %s does not load (%s); building again", path, error)
            path.unlink(missing_ok=True)
            for suffix in (".blank", ".o"):
                (cache_folder() / f"{_key(instructions)}{suffix}").unlink(missing_ok=True)
    return None


@cache
def _cpu() -> str:
    """Return what this processor can do: a cache in a shared home serves machines of any kind."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        return platform.processor()
    wanted = ("model name", "flags", "Features", "CPU part")
    return "\n".join(sorted({line for line in lines if line.startswith(wanted)}))


def generate_code(functions: Sequence[ca.Function]) -> str:
    """Return functions as C code."""
    generator = ca.CodeGenerator("pneumo", {"with_header": False, "indent": 1})
    for function in functions:
        generator.add(function)
    return str(generator.dump())


def _key(*code: str) -> str:
    """Return the name of what is built of code here: the compiler and the processor count."""
    machine = (platform.platform(), _cpu())
    parts = (*code, str(compiler()), *_flags(), ca.CasadiMeta.version(), *machine)
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


def _built(name: str, build: Callable[[Path], bool]) -> Path | None:
    """Return a file of the cache, built where it is missing or damaged; None where that fails."""
    path = cache_folder() / name
    if _is_intact(path):
        return path
    with draft_folder(path.parent, path.name) as scratch:
        draft = scratch / path.name
        if not build(draft):
            return None
        content = draft.read_bytes()
        draft.chmod(0o600)
        with draft.open("ab") as file:
            file.write(authentication_code(content))  # tells a file that a crash has cut short
        draft.replace(path)
    return path


def _link(instructions: str, table: ConstantTable, target: Path) -> bool:
    """Write a library of instructions, compiled where no other constants had them."""
    name = _key(instructions)
    blank = _built(f"{name}.blank", partial(_compile_blank, instructions, table))
    library = None if blank is None else table.filled(blank.read_bytes()[:-LENGTH])
    if library is not None:
        target.write_bytes(library)
        return True
    compiled = _built(f"{name}.o", partial(_compile, instructions))
    source = target.with_name("constants.c")
    source.write_text(table.code)
    return compiled is not None and _run(["-shared", str(source), str(compiled), "-lm"], target)


def _compile_blank(instructions: str, table: ConstantTable, target: Path) -> bool:
    """Compile and link code with a table that is to be filled; tell whether that is possible."""
    if not sys.platform.startswith(_FILLED):
        return False
    sources = [target.with_name("code.c"), target.with_name("constants.c")]
    for source, text in zip(sources, (instructions, table.blank_code), strict=True):
        source.write_text(text)
    # Optimised as a whole, the instructions would know the marks and not read the table.
    rest = ["-fno-lto", "-shared", *map(str, sources), "-lm"]
    return any(_run([*flags, *rest], target, last=False) for flags in (_flags(), PLAIN))


def _compile(instructions: str, target: Path) -> bool:
    """Compile code; tell whether it worked."""
    source = target.with_name("code.c")
    source.write_text(instructions)
    tries = (_flags(), PLAIN)
    return any(_run([*flags, "-c", str(source)], target, flags == PLAIN) for flags in tries)


def _flags() -> tuple[str, ...]:
    """Return the flags that are tried first."""
    return tuple(os.environ.get(FLAGS, "").split()) or FAST


def _run(arguments: Sequence[str], target: Path, last: bool = True) -> bool:
    """Run the compiler; tell whether it worked, and log why not unless there is another try."""
    command = [str(compiler()), *arguments, "-fPIC", "-o", str(target)]
    done = run_child(command, scratch=target.parent)
    if done.returncode != 0 and last:
        why = last_line(done.stderr)
        logger.warning("%s failed (%s); functions run interpreted", compiler(), why)
    return done.returncode == 0


def _is_intact(path: Path) -> bool:
    """Tell whether a library is there as this user has built it: its last bytes say so.

    Loading one that a full disk or a crash has cut short would end the process; one that somebody
    else has put there would do what they like.
    """
    if not path.exists() and not path.is_symlink():
        return False
    if is_own_file(path):
        content = path.read_bytes()
        code = authentication_code(content[:-LENGTH])
        if hmac.compare_digest(code, content[-LENGTH:]):
            return True
    logger.warning("compiled library %s is damaged, or not yours; building again", path)
    path.unlink()
    return False
