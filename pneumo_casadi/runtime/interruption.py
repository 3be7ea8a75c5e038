"""An orderly end at Ctrl-C, SIGTERM and SIGHUP, and a hard one where the first takes too long.

Python runs signal handlers between two of its own instructions: in a long compiled function none
is run. A thread, which the signal wakes at once, therefore ends the process after a time of grace.
"""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import FrameType
from typing import Any

#: Signals that ask a process to end: Ctrl-C, kill, closed terminal. Windows knows the first two.
ENDING = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
#: Time for the orderly end of a command [s]; with what follows it ends within two seconds.
GRACE = 0.8

_cleanups: list[Callable[[], object]] = []


@dataclass
class Interruption:
    """What a process was asked to end by (0: nothing yet), and what is to be said of it."""

    number: int = 0
    message: str = "interrupted; nothing was written"
    explained: bool = False

    @property
    def exit_code(self) -> int:
        """The exit code that shells give to a process that a signal has ended."""
        return 128 + (self.number or signal.SIGINT)

    @property
    def line(self) -> str:
        """The message as one line, with the name of the signal."""
        name = signal.Signals(self.number or signal.SIGINT).name
        return f"error: {self.message}{'' if name == 'SIGINT' else f' ({name})'}\n"


_current: list[Interruption] = []


def is_ending() -> bool:
    """Return whether this process was asked to end: an error may then be no result of the work.

    Inside a compiled function KeyboardInterrupt comes out as another error.
    """
    return any(interruption.number for interruption in _current)


@contextmanager
def at_hard_end(cleanup: Callable[[], object]) -> Iterator[None]:
    """Have `cleanup` called if the process comes to a hard end within the block.

    Parameters
    ----------
    cleanup : callable
        Called from another thread than the one in the block.
    """
    _cleanups.append(cleanup)
    try:
        yield
    finally:
        _cleanups.remove(cleanup)


@contextmanager
def interruptible(grace: float = GRACE) -> Iterator[Interruption]:
    """Raise KeyboardInterrupt once at the first signal that asks the process to end.

    Parameters
    ----------
    grace : float
        Time from the signal to the hard end [s]: what `at_hard_end` has registered is called, and
        the process ends with exit code 128 + number.

    Yields
    ------
    Interruption
        Its number is set by the signal: inside a compiled function KeyboardInterrupt comes out as
        another error, or not at all. Within another such block, the outer one's.
    """
    if _current:
        yield _current[-1]
        return
    interruption = Interruption()
    if threading.current_thread() is not threading.main_thread():  # no handler may be set here
        yield interruption
        return

    def interrupt(number: int, frame: FrameType | None) -> None:
        if not interruption.number:  # a second one must not disturb the orderly end
            interruption.number = number
            raise KeyboardInterrupt

    before: dict[int, Any] = {
        number: signal.signal(number, interrupt)
        for number in ENDING
        if signal.getsignal(number) is not signal.SIG_IGN  # as nohup has asked for
    }
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    wakeup = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    watch = threading.Thread(
        target=_watch, args=(reader, frozenset(before), grace, interruption), daemon=True
    )
    watch.start()
    _current.append(interruption)
    try:
        yield interruption
    finally:
        _current.remove(interruption)
        signal.set_wakeup_fd(wakeup)
        os.close(writer)  # ends the thread
        for number, handler in before.items():
            signal.signal(number, handler)


def _watch(reader: int, numbers: frozenset[int], grace: float, interruption: Interruption) -> None:
    while data := os.read(reader, 1):
        if data[0] in numbers:
            break
    else:
        os.close(reader)
        return
    # Signals that came in the meantime lie in the pipe; it is closed at the end of the block.
    deadline = time.monotonic() + grace
    os.set_blocking(reader, False)
    while time.monotonic() < deadline:
        with suppress(BlockingIOError):
            if not os.read(reader, 64):
                os.close(reader)
                return
        time.sleep(0.02)
    for cleanup in reversed(_cleanups):
        with suppress(Exception):
            cleanup()
    if not interruption.explained:
        interruption.number = data[0]
        os.write(2, interruption.line.encode())
    os._exit(128 + data[0])
