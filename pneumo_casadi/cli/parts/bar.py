"""The progress bar; imported only where one is shown, because rich is slow to import."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
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

#: Narrower terminals have no room for bar and clock beside the text [characters].
WIDE = 80
#: Characters of all columns but the text: bar, clock and time left; share and time left.
OTHERS, OTHERS_NARROW = 60, 25
#: The time left is shown once this share of the work is done.
SHOWN_FROM = 0.05


@contextmanager
def shown_bar() -> Iterator[Callable[[str, float], None]]:
    """Yield a callback that moves a progress bar on standard error."""
    console = Console(stderr=True, highlight=False)
    with Progress(*columns_for(console.width), console=console, transient=True) as bar:
        task = bar.add_task("reading", total=1.0, end=None)

        def report(text: str, share: float) -> None:
            elapsed = bar.tasks[0].elapsed or 0.0
            left = time_left(elapsed, share)
            end = None if left is None else elapsed + left
            bar.update(task, description=shortened(text, console.width), completed=share, end=end)

        yield report


def columns_for(width: int) -> tuple[ProgressColumn, ...]:
    """Return what a terminal of so many characters shows in one line, the text last."""
    text = TextColumn("{task.description}")
    if width < WIDE:
        return TextColumn("{task.percentage:3.0f} %"), _TimeLeft(), text
    return SpinnerColumn(), BarColumn(bar_width=30), TimeElapsedColumn(), _TimeLeft(), text


def shortened(text: str, width: int) -> str:
    """Return a text that leaves room for the other columns in a terminal of that width.

    Examples
    --------
    >>> shortened("output error, friction width 3 mm/s", 40)
    'output error, …'
    """
    room = width - (OTHERS if width >= WIDE else OTHERS_NARROW)
    return text if len(text) <= room else text[: room - 1] + "…"


def time_left(elapsed: float, share: float) -> float | None:
    """Return how long the rest of some work takes if it goes on at its pace [s].

    None while too little is done for an estimate.

    Examples
    --------
    >>> time_left(30.0, 0.75)
    10.0
    """
    return elapsed * (1 - share) / share if share >= SHOWN_FROM else None


class _TimeLeft(ProgressColumn):
    """Time left as of the last report, counted down since."""

    def render(self, task: Task) -> Text:
        end = task.fields.get("end")
        if end is None:
            return Text("")
        return Text(f"about {max(end - (task.elapsed or 0.0), 1.0):.0f} s left")
