"""Programs that end with this process, whatever ends it."""

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

from pneumo_casadi.runtime.interruption import at_hard_end

#: Environment variables that name the folder for temporary files.
_TEMPORARY = ("TMPDIR", "TMP", "TEMP")
#: Starts a program, and ends it when its parent is gone.
_WATCHER = Path(__file__).with_name("watcher.py")


def run_child(
    command: Sequence[str],
    content: bytes = b"",
    timeout: float | None = None,
    cwd: str | Path | None = None,
    env: Mapping[str, str] | None = None,
    scratch: str | Path | None = None,
) -> "subprocess.CompletedProcess[bytes]":
    """Run a program to its end; nothing of it outlives an interruption or this process.

    Parameters
    ----------
    command : sequence of str
        Program and arguments.
    content : bytes, optional
        Standard input.
    timeout : float, optional
        Longest time [s].
    cwd : str or Path, optional
        Folder in which it runs; by default that of this process.
    env : mapping of str to str, optional
        Environment; by default that of this process.
    scratch : str or Path, optional
        Folder for its temporary files, which a compiler that is killed leaves there.

    Returns
    -------
    subprocess.CompletedProcess
        Its exit code, standard output and standard error.

    Raises
    ------
    subprocess.TimeoutExpired
        If it takes longer.

    Examples
    --------
    >>> run_child([sys.executable, "-c", "print(6 * 7)"]).stdout.split()
    [b'42']
    """
    if scratch is not None:
        env = {**(os.environ if env is None else env), **dict.fromkeys(_TEMPORARY, str(scratch))}
    process = start_watched(command, subprocess.PIPE, cwd, env)
    with at_hard_end(partial(end_group, process)):
        try:
            output, errors = process.communicate(content, timeout)
        except BaseException:
            end_group(process)
            process.communicate()
            raise
    return subprocess.CompletedProcess(list(command), process.returncode, output, errors)


def start_watched(
    command: Sequence[str],
    errors: int,
    cwd: str | Path | None = None,
    env: Mapping[str, str] | None = None,
) -> "subprocess.Popen[bytes]":
    """Start a program in a group of its own, which ends with this process.

    Parameters
    ----------
    command : sequence of str
        Program and arguments.
    errors : int
        Where standard error goes, as `subprocess.Popen` takes it; the others are pipes.
    cwd, env
        As in `run_child`.
    """
    return subprocess.Popen(
        [sys.executable, "-I", "-S", str(_WATCHER), str(os.getpid()), *command],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=errors,
        cwd=cwd,
        env=env,
        start_new_session=True,
    )


def last_line(errors: bytes) -> str:
    """Return what a program says last on standard error, short.

    Parameters
    ----------
    errors : bytes
        All that it wrote there.
    """
    lines = errors.decode("utf-8", "replace").strip().splitlines() or ["no message"]
    return lines[-1][:200]


def end_group(process: "subprocess.Popen[bytes]") -> None:
    """End a watched program with all that it has started.

    Parameters
    ----------
    process : subprocess.Popen
        As `start_watched` returns it.
    """
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
