"""An attack: how its files are made, what reads them, and how its success shows."""

import contextlib
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

#: Seconds of processor time, and bytes of memory, that reading a file must not take.
TIME, MEMORY = 20, 6 * 2**30
#: Name of the file that code of an attack makes where it runs.
CANARY = "canary"


@dataclass(frozen=True)
class Attack:
    """A hostile file.

    Parameters
    ----------
    name : str
        What it tries.
    make : callable
        Writes it into a folder that holds a sound case, result and export; the path of the canary
        is the second argument.
    read : str
        Python that a user would run in that folder.
    won : callable, optional
        Whether it succeeded although no canary was made, from the folder and what was printed.
    fresh : bool, optional
        Whether it needs an interpreter that has not imported anything: it is about what is
        imported.
    files : int, optional
        How many hostile files it puts there.
    """

    name: str
    make: Callable[[Path, Path], None]
    read: str
    won: Callable[[Path, str], bool] = lambda folder, printed: False
    fresh: bool = False
    files: int = 1


def succeeds(attack: Attack, folder: Path, forked: bool = False) -> str:
    """Carry an attack out and return how it succeeded, or an empty text.

    Parameters
    ----------
    forked : bool, optional
        Whether to read the file in a fork of this process, which takes no time to start, unless
        the attack needs a fresh interpreter.
    """
    canary = folder.parent / f"{folder.name}.{CANARY}"
    attack.make(folder, canary)
    added = {"PNEUMO_CASADI_CACHE": str(folder.parent / "cache")}
    run = run_forked if forked and not attack.fresh else _run_apart
    done = run(attack.read, folder, added)
    if done is None:
        return "it hangs"
    code, printed = done
    if canary.exists():
        return "code was run"
    if code < 0:
        return f"the process ended with signal {-code}"
    if "MemoryError" in printed:
        return "memory was exhausted"
    if "Traceback" in printed and "pneumo_casadi.errors" not in printed:
        return f"a traceback: {printed.strip().splitlines()[-1][:200]}"
    return "it shows in the output" if attack.won(folder, printed) else ""


def _run_apart(read: str, folder: Path, added: Mapping[str, str]) -> tuple[int, str] | None:
    """Return exit code and output of an interpreter of its own; None where it hangs."""
    try:
        done = subprocess.run(
            # As the installed command runs: the current folder is not on the path of imports.
            [sys.executable, "-P", "-c", read],
            cwd=folder,
            env={**os.environ, **added},
            capture_output=True,
            timeout=10 * TIME,
            preexec_fn=_limit,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return None
    return done.returncode, (done.stdout + done.stderr).decode("utf-8", "replace")


def run_forked(read: str, folder: Path, added: Mapping[str, str]) -> tuple[int, str] | None:
    """Run Python in a fork of this process: what that has imported is there already.

    Parameters
    ----------
    read : str
        The code.
    folder : Path
        Where it runs; what it prints is kept beside it.
    added : mapping of str to str
        Variables that its environment has besides.

    Returns
    -------
    tuple or None
        Exit code and output; None where it hangs.
    """
    log = folder.parent / f"{folder.name}.log"
    sys.stdout.flush()
    pid = os.fork()
    if not pid:
        _be_read(read, folder, log, added)
    began = time.monotonic()
    while not (ended := os.waitpid(pid, os.WNOHANG))[0]:
        if time.monotonic() - began > 10 * TIME:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            return None
        time.sleep(0.01)
    return os.waitstatus_to_exitcode(ended[1]), log.read_text("utf-8", "replace")


def _be_read(read: str, folder: Path, log: Path, added: Mapping[str, str]) -> None:
    """Run in a fork what reads a file, and end the process."""
    code = 1
    try:
        os.chdir(folder)
        os.environ.update(added)
        tempfile.tempdir = None  # what this process remembers need not be what TMPDIR names
        output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        os.dup2(output, 1)
        os.dup2(output, 2)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        _limit()
        exec(compile(read, "<attack>", "exec"), {"__name__": "__main__"})
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:  # whatever happens, a fork must not go on with the work of its parent
        with contextlib.suppress(OSError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def _limit() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (TIME, TIME))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
