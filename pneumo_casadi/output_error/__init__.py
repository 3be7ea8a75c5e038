"""Output error by multiple shooting: the parameters whose trajectories lie nearest to the data."""

from pneumo_casadi.output_error.fit import Method, OutputErrorOptions, fit_output_error
from pneumo_casadi.output_error.result import Derived, MapPull, OutputErrorResult, Stage

__all__ = [
    "Derived",
    "MapPull",
    "Method",
    "OutputErrorOptions",
    "OutputErrorResult",
    "Stage",
    "fit_output_error",
]
