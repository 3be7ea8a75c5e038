"""The command ``export``: an identified model for other tools."""

from pathlib import Path
from typing import Annotated

import typer

from pneumo_casadi.cli.options import Debug, FormatName
from pneumo_casadi.cli.terminal import guarded, say
from pneumo_casadi.errors import CaseError


def export(
    result: Annotated[
        Path,
        typer.Argument(metavar="RESULT", help="Folder or result.json of identify or diagnose."),
    ],
    kind: Annotated[FormatName, typer.Option("--format", "-f", help="Format of the files.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="Output folder.")
    ],
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            metavar="NAME=VALUE",
            help="Operating point of --format ss: a state or input in SI units; can be repeated. "
            "The others are computed for equilibrium.",
        ),
    ] = None,
    debug: Debug = False,
) -> None:
    """Write an identified model for other tools: json, casadi, c, fmu or ss (state space).

    The case folder is not needed. Files of an earlier export in FOLDER are replaced, others are
    kept.
    """
    with guarded(debug):
        from pneumo_casadi.export import export_model

        point = _point(at or [])
        if point and kind != "ss":
            raise CaseError(f"--at applies to --format ss only, not to {kind}")
        for path in export_model(result, output, kind, point):
            say(str(path))


def _point(texts: list[str]) -> dict[str, float]:
    point: dict[str, float] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = float("nan")
        if not equals or number != number or name in point:
            raise CaseError(
                f"--at {text}: expected NAME=VALUE in SI units, as x=0.1, each name once"
            )
        point[name] = number
    return point
