"""Arguments and options that several commands share.

Here, and at the top of every command's module, nothing heavy is imported: `--help` must be quick.
Choices are therefore written out; a test compares them with the enums of the library.
"""

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
    Path, typer.Option("--parameters", "-p", help="result.json written by identify.")
]
Output = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="FOLDER", help="Output folder of the report."),
]
Json = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Also write the result to this JSON file."),
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
        help="Form of the flow map; auto: the form with the smallest cross-validation error.",
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
