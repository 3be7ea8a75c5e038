"""Arguments and options that several commands share.

Here, and at the top of every command's module, nothing heavy is imported: `--help` must be quick.
Choices are therefore written out; a test compares them with the enums of the library.
"""

import math
from collections.abc import Sequence
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from pneumo_casadi.errors import CaseError

if TYPE_CHECKING:
    from pneumo_casadi.valve import FlowForm

CasePath = Annotated[
    Path, typer.Argument(metavar="CASE", help="Folder with bench.json and records.")
]
Parameters = Annotated[
    Path,
    typer.Option(
        "--parameters",
        "-p",
        metavar="RESULT",
        help="Report folder of identify or diagnose, or its result.json.",
    ),
]
Output = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="FOLDER", help="Output folder of the report."),
]
Json = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Also write the result to this JSON file."),
]
Strict = Annotated[
    bool,
    typer.Option("--strict", help="Exit with code 3 if the result is not to be used."),
]
Debug = Annotated[bool, typer.Option("--debug", help="Show tracebacks and the log.")]
CriterionName = Literal["D", "A", "E"]
RecordSetName = Literal["identify", "validate"]
FormatName = Literal["json", "casadi", "c", "fmu", "ss"]


def report_folder(output: Path | None, case: Path, suffix: str = "") -> Path:
    """Return the folder of a report: as given, or named after the case below ``report``."""
    return output or Path("report") / f"{case.resolve().name}{suffix}"


class FlowOption(Enum):
    """Form of the flow map, as the command line names it."""

    AUTO = "auto"
    POLYNOMIALS = "polynomials"
    ISO6358 = "iso6358"
    ISO6358_CURVE = "iso6358_curve"
    SPLINE = "spline"

    @property
    def form(self) -> "FlowForm | None":
        """The form itself; None where it is to be chosen."""
        from pneumo_casadi.valve import FlowForm  # heavy, and not needed for --help

        return None if self is FlowOption.AUTO else FlowForm(self.value)


Flow = Annotated[
    FlowOption,
    typer.Option(
        "--flow",
        help="Form of the flow map; auto: of the forms within one standard error of the smallest "
        "cross-validation error the first of polynomials, iso6358, iso6358_curve, spline.",
    ),
]
Degrees = Annotated[
    str | None,
    typer.Option(
        "--degrees",
        metavar="PHI,PLUS,MINUS",
        help="Degrees of the flow polynomials φ, ψ(u > 0), ψ(u < 0), as 7,7,4; default: 7,7,4 "
        "with --flow polynomials, else by cross-validation.",
    ),
]


def degrees_of(text: str | None) -> tuple[int, int, int] | None:
    """Return the degrees that ``--degrees`` gives.

    Raises
    ------
    CaseError
        If they are not three whole numbers.

    Examples
    --------
    >>> degrees_of("7,7,4")
    (7, 7, 4)
    """
    if text is None:
        return None
    try:
        phi, plus, minus = (int(part) for part in text.split(","))
    except ValueError:
        raise CaseError(f"--degrees {text}: expected three whole numbers, as 7,7,4") from None
    return phi, plus, minus


def values_of(option: str, texts: Sequence[str]) -> dict[str, float]:
    """Return what a repeated option ``NAME=VALUE`` gives.

    Raises
    ------
    CaseError
        If one is no name with a finite number, or a name comes twice.

    Examples
    --------
    >>> values_of("--fix", ["M=16.4", "f_v=11"])
    {'M': 16.4, 'f_v': 11.0}
    """
    values: dict[str, float] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not (name and equals and math.isfinite(number)) or name in values:
            raise CaseError(
                f"{option} {text}: expected NAME=VALUE in SI units, as M=16.4, each name once"
            )
        values[name] = number
    return values


def time_and_values(texts: Sequence[str]) -> tuple[float | None, dict[str, float]]:
    """Return what ``--start`` gives: a time [s], and starting values by name.

    Raises
    ------
    CaseError
        If two times are given, or a text is neither.

    Examples
    --------
    >>> time_and_values(["10", "k_P=1.2"])
    (10.0, {'k_P': 1.2})
    """
    times = [text for text in texts if "=" not in text]
    values = values_of("--start", [text for text in texts if "=" in text])
    try:
        (time,) = map(float, times or ["nan"])
    except ValueError:
        raise CaseError(
            f"--start {' --start '.join(times)}: expected one time in seconds, as 10, or "
            "NAME=VALUE, as k_P=1.2"
        ) from None
    return time if times else None, values
