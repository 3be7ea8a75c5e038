"""The errors of the package, by who can correct them.

Every message names the offender (file, row, parameter), its value and unit, and the remedy.
"""

from typing import Any


class PneumoError(Exception):
    """Base of all errors that the package raises on purpose."""


class CaseError(PneumoError, ValueError):
    """Data that contradict their description: correct the file or the description."""


class ModelError(PneumoError, ValueError):
    """A model that cannot be built or evaluated as requested: correct the call."""


class FitError(PneumoError, RuntimeError):
    """An estimation that did not reach an optimum.

    Parameters
    ----------
    message : str
        What failed, the state of the iteration and what to try next.
    partial : object, optional
        The unfinished result; it is not a solution.
    """

    def __init__(self, message: str, partial: Any = None) -> None:
        super().__init__(message)
        self.partial = partial


class MissingExtraError(PneumoError, ImportError):
    """A part that needs an optional dependency: install the extra that the message names."""
