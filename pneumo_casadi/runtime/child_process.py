"""Programs that end with this process, whatever ends it.

Run as a script, without the rest of the package: it starts a program in a group of processes of its
own and ends the whole group when its parent is gone. A compiler is a driver with children, which
the death of the driver alone would leave.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

#: How often the parent is looked for [s]: far below the five seconds in which all is to be gone.
PERIOD = 0.2
#: Environment variables that name the folder for temporary files.
_TEMPORARY = ("TMPDIR", "TMP", "TEMP")


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

    Raises
    ------
    subprocess.TimeoutExpired
        If it takes longer.

    Examples
    --------
    >>> run_child([sys.executable, "-c", "print(6 * 7)"]).stdout.split()
    [b'42']
    """
    from pneumo_casadi.runtime.interruption import at_hard_end

    if scratch is not None:
        env = {**(os.environ if env is None else env), **dict.fromkeys(_TEMPORARY, str(scratch))}
    watched = [sys.executable, "-I", "-S", __file__, str(os.getpid()), *command]
    process = subprocess.Popen(
        watched,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=cwd,
        env=env,
        start_new_session=True,
    )
    with at_hard_end(partial(_end_group, process)):
        try:
            output, errors = process.communicate(content, timeout)
        except BaseException:
            _end_group(process)
            process.communicate()
            raise
    return subprocess.CompletedProcess(list(command), process.returncode, output, errors)


def last_line(errors: bytes) -> str:
    """Return what a program says last on standard error, short."""
    lines = errors.decode("utf-8", "replace").strip().splitlines() or ["no message"]
    return lines[-1][:200]


def _end_group(process: "subprocess.Popen[bytes]") -> None:
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()


def main() -> None:
    """Run the program that the arguments name, and end as it does."""
    parent, command = int(sys.argv[1]), sys.argv[2:]
    process = subprocess.Popen(command)
    while True:
        with suppress(subprocess.TimeoutExpired):
            code = process.wait(PERIOD)
            break
        if os.name == "posix" and os.getppid() != parent:
            os.killpg(0, signal.SIGKILL)
    if code < 0:
        os.kill(os.getpid(), -code)
    sys.exit(code)


if __name__ == "__main__":
    main()
