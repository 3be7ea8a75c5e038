"""Output error by multiple shooting: the parameters whose trajectories lie nearest to the data."""

from pneumo_casadi.estimation.output_error.fit import fit_output_error
from pneumo_casadi.estimation.output_error.multistart import (
    MultiStart,
    Outcome,
    fit_from_many_starts,
)
from pneumo_casadi.estimation.output_error.options import Method, OutputErrorOptions
from pneumo_casadi.estimation.output_error.result import Derived, MapPull, OutputErrorResult, Stage

__all__ = [
    "Derived",
    "MapPull",
    "Method",
    "MultiStart",
    "Outcome",
    "OutputErrorOptions",
    "OutputErrorResult",
    "Stage",
    "fit_from_many_starts",
    "fit_output_error",
]
