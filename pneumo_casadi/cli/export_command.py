"""The command ``export``: an identified model for other tools."""

from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from pneumo_casadi.cli.terminal import guarded, out
from pneumo_casadi.errors import CaseError
from pneumo_casadi.export import (
    IdentifiedModel,
    read_model,
    write_c,
    write_fmu,
    write_functions,
    write_model,
    write_state_space,
)


class Format(Enum):
    """What an identified model is written as."""

    JSON = "json"
    """Model and provenance; read back by ``read_model``."""
    CASADI = "casadi"
    """Functions rhs, step and output of CasADi with a sidecar."""
    C = "c"
    """Self-contained C with an example."""
    FMU = "fmu"
    """FMI 3.0, co-simulation and model exchange."""
    SS = "ss"
    """Linear state space, JSON and MAT."""


def export(
    result: Annotated[
        Path, typer.Argument(metavar="RESULT", help="Folder or result.json written by identify.")
    ],
    kind: Annotated[Format, typer.Option("--format", "-f", help="What to write.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="Where the files go.")
    ],
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            metavar="NAME=VALUE",
            help="Operating point of --format ss: a state or input in SI units; repeat it. What is "
            "not named is found such that the axis rests.",
        ),
    ] = None,
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks and the log.")] = False,
) -> None:
    """Write an identified model for other tools: json, casadi, c, fmu or ss (state space).

    The result holds all that is needed; the case folder may be gone. Files of an earlier export
    in FOLDER are replaced, others are left alone.
    """
    with guarded(debug):
        point = _point(at or [])
        if point and kind is not Format.SS:
            raise CaseError(f"--at is for --format ss alone, not for {kind.value}")
        writers: dict[Format, Callable[[IdentifiedModel], Path | tuple[Path, ...]]] = {
            Format.JSON: lambda model: write_model(model, output),
            Format.CASADI: lambda model: write_functions(model, output),
            Format.C: lambda model: write_c(model, output),
            Format.FMU: lambda model: write_fmu(model, output),
            Format.SS: lambda model: write_state_space(model, output, point),
        }
        written = writers[kind](read_model(result))
        for path in written if isinstance(written, tuple) else (written,):
            out.print(path, soft_wrap=True, markup=False)


def _point(texts: list[str]) -> dict[str, float]:
    found: dict[str, float] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = float("nan")
        if not equals or number != number or name in found:
            raise CaseError(f"--at {text}: write a name once, as x=0.1, a number in SI units")
        found[name] = number
    return found
