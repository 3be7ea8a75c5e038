"""The options ``--flow`` and ``--degrees``."""

from enum import Enum
from typing import Annotated

import typer

from pneumo_casadi.errors import CaseError
from pneumo_casadi.valve import FlowForm


class FlowOption(Enum):
    """Form of the flow map, as the command line names it."""

    AUTO = "auto"
    POLYNOMIALS = FlowForm.POLYNOMIALS.value
    ISO6358 = FlowForm.ISO6358.value
    SPLINE = FlowForm.SPLINE.value

    @property
    def form(self) -> FlowForm | None:
        """The form itself; None where it is to be chosen."""
        return None if self is FlowOption.AUTO else FlowForm(self.value)


Flow = Annotated[
    FlowOption,
    typer.Option(
        "--flow", help="Form of the flow map; auto: the one with the least held-out error on it."
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
