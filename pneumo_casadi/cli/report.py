"""The command ``report``: a report written again from a result file."""

from pathlib import Path
from typing import Annotated

import typer

from pneumo_casadi.cli.options import Debug
from pneumo_casadi.cli.terminal import guarded, say


def report(
    result: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER", help="Report folder of identify, or its result.json alone."
        ),
    ],
    debug: Debug = False,
) -> None:
    """Write report.html again from a result file alone, without the records.

    Time plots come from curves.json beside it; figures that need the records are left out.
    """
    with guarded(debug):
        from pneumo_casadi.report.pages.again import write_report_again

        say(f"report: {write_report_again(result)}")
