"""The command ``example``: a small case to start from."""

from pathlib import Path
from typing import Annotated

import typer

from pneumo_casadi.cli.options import Debug
from pneumo_casadi.cli.terminal import guarded, say


def example(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="New folder of the case.")],
    debug: Debug = False,
) -> None:
    """Write a small case to start from: 10 s to identify on and 8 s held out, at 1 kHz.

    Its CSV files have names and units of their own (bar gauge, mm, ms), and columns.json says what
    they are: replace them by yours.
    """
    with guarded(debug):
        from pneumo_casadi.data.example_folder import write_example

        case = write_example(folder)
        for path in sorted(case.folder.iterdir()):
            say(str(path))
        say(f"\nnext: pneumo-casadi check {folder}\nthen: pneumo-casadi identify {folder}")
