"""Programs that end with this process, whatever ends it.

Run as a script, without the rest of the package: it starts a program in a group of processes of its
own and ends the whole group when its parent is gone. A compiler is a driver with children, which
the death of the driver alone would leave.
"""

import atexit
import os
import signal
import struct
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import IO

#: How often the parent is looked for [s]: far below the five seconds in which all is to be gone.
PERIOD = 0.2
#: Environment variables that name the folder for temporary files.
_TEMPORARY = ("TMPDIR", "TMP", "TEMP")
#: The length that begins a request to a `ServingChild`, and its answer.
_LENGTH = struct.Struct("<Q")


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
        [sys.executable, "-I", "-S", __file__, str(os.getpid()), *command],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=errors,
        cwd=cwd,
        env=env,
        start_new_session=True,
    )


class ChildEndedError(Exception):
    """The program has ended without an answer."""


class ServingChild:
    """A program that is started at the first request, and anew after one that it did not survive.

    Parameters
    ----------
    command : sequence of str
        Program and arguments; it answers what it reads on standard input. A request and its answer
        are a length of eight bytes, the lowest first, and as many bytes.
    env : mapping of str to str, optional
        What its environment has besides that of this process.

    Examples
    --------
    >>> child = ServingChild(["cat"])  # answers with what it was asked
    >>> child.ask(b"one", 20.0), child.ask(b"two", 20.0)
    (b'one', b'two')
    >>> child.end()
    """

    def __init__(self, command: Sequence[str], env: Mapping[str, str] | None = None) -> None:
        self._command, self._env = tuple(command), dict(env or {})
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = 0
        self._turn = threading.Lock()

    def ask(self, request: bytes, timeout: float) -> bytes:
        """Return the answer to a request.

        Parameters
        ----------
        request : bytes
            As the program understands it.
        timeout : float
            Longest time [s].

        Raises
        ------
        TimeoutError
            If the answer takes longer; the program is ended.
        ChildEndedError
            If the program ends without an answer.
        """
        from pneumo_casadi.runtime.interruption import at_hard_end

        late = threading.Event()

        def give_up(process: "subprocess.Popen[bytes]") -> None:
            late.set()
            end_group(process)

        with self._turn:
            process = self._running()
            limit = threading.Timer(timeout, give_up, (process,))
            limit.daemon = True
            limit.start()
            try:
                with at_hard_end(partial(end_group, process)):
                    return _exchange(process, request)
            except (OSError, EOFError):
                self._end()
                raise TimeoutError if late.is_set() else ChildEndedError from None
            except BaseException:
                self._end()
                raise
            finally:
                limit.cancel()

    def end(self) -> None:
        """End the program; the next request starts it anew."""
        with self._turn:
            self._end()

    def _running(self) -> "subprocess.Popen[bytes]":
        if self._owner != os.getpid():  # a fork has a program of its own
            self._process, self._owner = None, os.getpid()
            atexit.register(self.end)
        if self._process is not None and self._process.poll() is not None:
            self._end()
        if self._process is None:
            env = {**os.environ, **self._env}
            home = Path(sys.executable).parent  # it keeps no folder of the user's in use
            self._process = start_watched(self._command, subprocess.DEVNULL, home, env)
        return self._process

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None or self._owner != os.getpid():
            return
        end_group(process)
        process.wait()
        for pipe in (process.stdin, process.stdout):
            with suppress(OSError):
                if pipe is not None:
                    pipe.close()


def _exchange(process: "subprocess.Popen[bytes]", request: bytes) -> bytes:
    if process.stdin is None or process.stdout is None:
        raise EOFError
    process.stdin.write(_LENGTH.pack(len(request)) + request)
    process.stdin.flush()
    answer = _read(process.stdout)
    if answer is None:
        raise EOFError
    return answer


def _read(stream: IO[bytes]) -> bytes | None:
    """Return the next message of a stream, None at its end."""
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return None
    (length,) = _LENGTH.unpack(head)
    message = stream.read(length)
    return message if len(message) == length else None


def last_line(errors: bytes) -> str:
    """Return what a program says last on standard error, short."""
    lines = errors.decode("utf-8", "replace").strip().splitlines() or ["no message"]
    return lines[-1][:200]


def end_group(process: "subprocess.Popen[bytes]") -> None:
    """End a watched program with all that it has started."""
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
