"""A program that answers one request after the other, and ends with this process.

What it imports is imported once for all requests.
"""

import atexit
import os
import struct
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import IO

from pneumo_casadi.runtime.children.running import end_group, start_watched
from pneumo_casadi.runtime.interruption import at_hard_end

#: The length that begins a request, and its answer.
_LENGTH = struct.Struct("<Q")


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
