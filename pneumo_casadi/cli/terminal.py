"""The terminal: text, tables, a progress bar, errors in one line, Ctrl-C."""

import logging
import shutil
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import typer

from pneumo_casadi.errors import FitError, PneumoError
from pneumo_casadi.runtime.input_files import printable
from pneumo_casadi.runtime.interruption import interruptible
from pneumo_casadi.runtime.processes import WorkerDiedError

if TYPE_CHECKING:
    from pneumo_casadi.identification.warnings import Usable
    from pneumo_casadi.report.tables.table import Table

#: Seconds between lines of progress in a log file: a job of ten minutes fills half a page.
LOG_SECONDS = 30.0
OK, FIT_FAILED, BAD_INPUT, NOT_USABLE = 0, 1, 2, 3


def say(text: str = "") -> None:
    """Print text on standard output, control characters of names escaped."""
    typer.echo("\n".join(printable(line) for line in text.split("\n")))


def width() -> int:
    """Return the width of the terminal in characters."""
    return shutil.get_terminal_size().columns


def show(table: "Table") -> None:
    """Print a table; on a narrow terminal without the column of differences."""
    from pneumo_casadi.report.text.identification import render

    if sum(table.widths) + 2 * len(table.widths) > width():
        table = table.without("OE - truth")
    say(render(table))


def exit_unless_usable(usable: "Usable", strict: bool) -> None:
    """End the command with exit code 3 where ``--strict`` refuses a result.

    A result that is usable with care passes: its cautions are read by a person, and a script that
    must stop at them reads ``usable`` from the JSON.
    """
    from pneumo_casadi.identification.warnings import Usable

    if strict and usable is Usable.NO:
        raise typer.Exit(NOT_USABLE)


@contextmanager
def progress_bar() -> Iterator[Callable[[str, float], None]]:
    """Yield a callback that moves a progress bar on standard error; in a log file, some lines."""
    if not sys.stderr.isatty():
        yield log_progress(time.monotonic)
        return
    from pneumo_casadi.cli.parts.bar import shown_bar

    with shown_bar() as report:
        yield report


def log_progress(clock: Callable[[], float]) -> Callable[[str, float], None]:
    """Return a callback that writes a line on standard error every `LOG_SECONDS`.

    Parameters
    ----------
    clock : callable
        Returns seconds.
    """
    began = last = clock()

    def report(text: str, share: float) -> None:
        nonlocal last
        now = clock()
        if now - last < LOG_SECONDS:
            return
        last = now
        left = f", about {(now - began) * (1 - share) / share:.0f} s left" if share > 0 else ""
        typer.echo(f"{100 * share:.0f} %{left}: {printable(text)}", err=True)

    return report


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
    handler = logging.StreamHandler()
    logger = logging.getLogger("pneumo_casadi")
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG if debug else logging.WARNING)
    try:
        with warnings.catch_warnings(), interruptible() as interruption:
            from pneumo_casadi.signals.filter_plan import SamplingWarning

            interruption.message = f"interrupted; {kept}"
            warnings.simplefilter("ignore", SamplingWarning)  # among the result's own warnings
            yield
    except (KeyboardInterrupt, Exception) as raised:
        interrupted = interruption.number or isinstance(raised, KeyboardInterrupt)
        if not interrupted and not isinstance(raised, PneumoError | OSError):
            raise  # a defect
        if debug:
            traceback.print_exc()
        if interrupted:
            typer.echo(interruption.line, err=True, nl=False)
            interruption.explained = True
            raise typer.Exit(interruption.exit_code) from None
        complain(str(raised))
        failed = isinstance(raised, FitError | WorkerDiedError)
        raise typer.Exit(FIT_FAILED if failed else BAD_INPUT) from None
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)


def complain(message: str) -> None:
    """Print an error as one line on standard error."""
    typer.echo(f"error: {printable(' '.join(message.split()))}", err=True)
