"""Simulations of held-out records, and how far they are from what was measured."""

from pneumo_casadi.validation.errors import Error, errors_of_runs, loop_errors, window_errors
from pneumo_casadi.validation.simulations import (
    Rows,
    free_run,
    loop_run,
    window_curves,
    window_runs,
)
from pneumo_casadi.validation.validate import Run, Validation, validate

__all__ = [
    "Error",
    "Rows",
    "Run",
    "Validation",
    "errors_of_runs",
    "free_run",
    "loop_errors",
    "loop_run",
    "validate",
    "window_curves",
    "window_errors",
    "window_runs",
]
