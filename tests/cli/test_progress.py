"""Progress: one line at any width, and few lines in a log file."""

from io import StringIO

import pytest
from rich.console import Console
from rich.progress import Progress

from pneumo_casadi.cli.parts.bar import columns_for, shortened
from pneumo_casadi.cli.terminal import LOG_SECONDS, log_progress


@pytest.mark.parametrize("width", [40, 60, 100])
def test_progress_is_one_line_with_the_time_left(width):
    console = Console(width=width, file=StringIO(), force_terminal=False)
    bar = Progress(*columns_for(width), console=console)
    text = "output error over the whole record, friction width 3 mm/s"
    task = bar.add_task(shortened(text, width), total=1.0, completed=0.45, end=125.0)
    console.print(bar.make_tasks_table([bar.tasks[task]]))
    (line,) = console.file.getvalue().rstrip("\n").split("\n")
    assert len(line) <= width
    assert "about 125 s left" in line and "output" in line


def test_a_log_file_gets_a_line_now_and_then(capsys):
    times = iter([0.0, 1.0, LOG_SECONDS + 1, LOG_SECONDS + 2, 3 * LOG_SECONDS])
    report = log_progress(lambda: next(times))
    for share in (0.1, 0.25, 0.26, 0.5):
        report("fitting", share)
    assert capsys.readouterr().err.splitlines() == [
        "25 %, about 93 s left: fitting",
        "50 %, about 90 s left: fitting",
    ]
