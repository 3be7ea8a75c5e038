"""The terminal: tables, a progress bar, errors in one line, Ctrl-C."""

import logging
import signal
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, current_thread, main_thread
from types import FrameType

import typer
from rich.console import Console
from rich.logging import RichHandler
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
)
from rich.text import Text

from pneumo_casadi.errors import FitError, PneumoError
from pneumo_casadi.report.tables.results import Table
from pneumo_casadi.report.text.identification import render
from pneumo_casadi.signals.filter_plan import SamplingWarning

OK, FIT_FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

#: Of the time left nothing is said before this share of the work is done.
TELLING = 0.05

out = Console(highlight=False)
err = Console(stderr=True, highlight=False)


def show(table: Table) -> None:
    """Print a table; where the terminal is narrow, without the columns that can be worked out."""
    if sum(table.widths) + 2 * len(table.widths) > out.width:
        table = table.without("OE - truth")
    out.print(render(table), markup=False, soft_wrap=True)


@contextmanager
def progress_bar() -> Iterator[Callable[[str, float], None]]:
    """Yield a callback that moves a progress bar on standard error."""
    columns = (
        SpinnerColumn(),
        BarColumn(bar_width=30),
        TimeElapsedColumn(),
        _TimeLeft(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bar:
        task = bar.add_task("reading", total=1.0, end=None)

        def report(text: str, share: float) -> None:
            elapsed = bar.tasks[0].elapsed or 0.0
            left = time_left(elapsed, share)
            end = None if left is None else elapsed + left
            bar.update(task, description=text, completed=share, end=end)

        yield report


def time_left(elapsed: float, share: float) -> float | None:
    """Return how long the rest of some work takes if it goes on at its pace [s].

    None while too little is done to tell.

    Examples
    --------
    >>> time_left(30.0, 0.75)
    10.0
    """
    return elapsed * (1 - share) / share if share >= TELLING else None


class _TimeLeft(ProgressColumn):
    """Time left as of the last report, counted down since."""

    def render(self, task: Task) -> Text:
        end = task.fields.get("end")
        if end is None:
            return Text("")
        return Text(f"about {max(end - (task.elapsed or 0.0), 1.0):.0f} s left")


@contextmanager
def guarded(debug: bool, kept: str = "nothing was written") -> Iterator[None]:
    """Turn errors into one line on standard error and an exit code.

    Parameters
    ----------
    debug : bool
        Whether to show tracebacks and the log.
    kept : str, optional
        What to say of the work done when it is interrupted.
    """
    handler = RichHandler(console=err, show_path=False, show_time=False)
    logger = logging.getLogger("pneumo_casadi")
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG if debug else logging.WARNING)
    try:
        with warnings.catch_warnings(), _interruption() as interrupted:
            warnings.simplefilter("ignore", SamplingWarning)  # among the result's own warnings
            yield
    except (KeyboardInterrupt, Exception) as error:
        found = KeyboardInterrupt() if interrupted.is_set() else error
        if not isinstance(found, KeyboardInterrupt | PneumoError | OSError):
            raise  # a defect
        if debug:
            err.print_exception()
        raise typer.Exit(explain(found, kept)) from None
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)


@contextmanager
def _interruption() -> Iterator[Event]:
    """Yield an event that is set by Ctrl-C.

    Inside a compiled function KeyboardInterrupt comes out as another error, or not at all.
    """
    event = Event()

    def interrupt(number: int, frame: FrameType | None) -> None:
        event.set()
        raise KeyboardInterrupt

    if current_thread() is not main_thread():  # only there may a handler be set
        yield event
        return
    before = signal.signal(signal.SIGINT, interrupt)
    try:
        yield event
    finally:
        signal.signal(signal.SIGINT, before)


def explain(error: BaseException, kept: str) -> int:
    """Say in one line what went wrong and return the exit code."""
    if isinstance(error, KeyboardInterrupt):
        complain(f"interrupted; {kept}")
        return INTERRUPTED
    complain(str(error))
    return FIT_FAILED if isinstance(error, FitError) else BAD_INPUT


def complain(message: str) -> None:
    """Print an error as one line on standard error."""
    err.print(f"error: {' '.join(message.split())}", markup=False, soft_wrap=True)
