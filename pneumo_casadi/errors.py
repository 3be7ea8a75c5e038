"""What can go wrong, by who can mend it.

Every message names the offender (file, row, parameter), its value and unit, and the remedy.
"""

from typing import Any


class PneumoError(Exception):
    """Base of all errors that the package raises on purpose."""


class CaseError(PneumoError, ValueError):
    """Data that cannot be what they claim to be: mend the file or its description."""


class ModelError(PneumoError, ValueError):
    """A model that cannot be built or evaluated as asked: mend the call."""


class FitError(PneumoError, RuntimeError):
    """An estimation that did not reach an optimum.

    Parameters
    ----------
    message : str
        What failed, where the iteration stood and what to try next.
    partial : object, optional
        The result as far as it got; never to be taken for a solution.
    """

    def __init__(self, message: str, partial: Any = None) -> None:
        super().__init__(message)
        self.partial = partial


class MissingExtraError(PneumoError, ImportError):
    """A part that needs an optional dependency: install the extra that the message names."""
