"""CasADi functions as machine code: generated C, compiled once, cached by content.

Where no C compiler is found the functions are used as they are, with one notice.
"""

import hashlib
import logging
import os
import platform
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import casadi as ca

logger = logging.getLogger(__name__)

#: Optimisation flags, part of the cache key. Higher levels compile longer and run no faster.
FLAGS = ("-O1", "-shared", "-fPIC")
#: Environment variable that switches compilation off ("0") or names the cache folder.
SWITCH, FOLDER = "PNEUMO_CASADI_COMPILE", "PNEUMO_CASADI_CACHE"


def cache_folder() -> Path:
    """Return the folder of compiled functions, made by this user and for this user only."""
    base = os.environ.get(FOLDER)
    if base:
        folder = Path(base)
    else:
        home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        folder = Path(home) / "pneumo_casadi"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if hasattr(os, "getuid"):
        # Libraries in it are loaded and run: nobody else may be able to put one there.
        state = folder.stat()
        if state.st_uid != os.getuid() or state.st_mode & 0o022:
            raise PermissionError(
                f"{folder}: others may write to it; make it yours alone (chmod 700), or name "
                f"another folder in {FOLDER}"
            )
    return folder


@cache
def compiler() -> str | None:
    """Return the path of the C compiler, or None where there is none or it is switched off."""
    if os.environ.get(SWITCH) == "0":
        return None
    for name in (os.environ.get("CC", ""), "gcc", "cc", "clang"):
        found = shutil.which(name) if name else None
        if found:
            return found
    logger.warning(
        "no C compiler found: functions run interpreted, several times slower; "
        "install gcc or clang, or set %s=0 to silence this",
        SWITCH,
    )
    return None


def compiled(functions: Sequence[ca.Function]) -> tuple[ca.Function, ...]:
    """Return the functions compiled to machine code.

    Parameters
    ----------
    functions : sequence of casadi.Function
        With different names; what they call is compiled with them.

    Returns
    -------
    tuple of casadi.Function
        With the same names and signatures; the very functions given where compiling is not
        possible (no compiler, code that the compiler refuses, a cache that cannot be written),
        after a logged warning.

    Notes
    -----
    The library's file name is the hash of its C code, the flags and the compiler, so a changed
    model never meets an old library. It is written beside its final place and renamed, so that
    two processes may build at once; a library that does not load is built again.

    Examples
    --------
    >>> import casadi as ca
    >>> x = ca.SX.sym("x")
    >>> (square,) = compiled([ca.Function("square", [x], [x**2])])
    >>> float(square(3))
    9.0
    """
    cc = compiler()
    if cc is None:
        return tuple(functions)
    code = _generate(functions)
    key = hashlib.sha256(
        "\0".join((code, cc, *FLAGS, ca.CasadiMeta.version(), platform.platform())).encode()
    )
    for attempt in range(2):
        try:
            path = cache_folder() / f"{key.hexdigest()[:32]}.so"
            if not path.exists() and not _build(cc, code, path):
                return tuple(functions)
        except OSError as error:
            logger.warning(
                "cannot write to the cache (%s): functions run interpreted; set %s to a folder "
                "that can be written",
                error,
                FOLDER,
            )
            return tuple(functions)
        try:
            return tuple(ca.external(f.name(), str(path)) for f in functions)
        except RuntimeError as error:
            logger.warning("compiled library %s does not load (%s); building again", path, error)
            path.unlink(missing_ok=True)
            if attempt:
                break
    return tuple(functions)


def _generate(functions: Sequence[ca.Function]) -> str:
    generator = ca.CodeGenerator("pneumo", {"with_header": False, "indent": 1})
    for function in functions:
        generator.add(function)
    return str(generator.dump())


def _build(cc: str, code: str, path: Path) -> bool:
    """Compile `code` to `path` by way of a temporary file; tell whether it worked."""
    with tempfile.TemporaryDirectory(dir=path.parent) as scratch:
        source, library = Path(scratch) / "code.c", Path(scratch) / "code.so"
        source.write_text(code)
        command = [cc, *FLAGS, str(source), "-o", str(library), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            tail = done.stderr.strip().splitlines()[-1:] or ["no message"]
            logger.warning("%s failed (%s); functions run interpreted", cc, tail[0])
            return False
        library.replace(path)
    return True
