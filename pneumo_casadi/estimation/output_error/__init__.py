"""Output error by multiple shooting: the parameters whose trajectories lie nearest to the data."""

from pneumo_casadi.estimation.output_error.each_record import RecordEstimates, fit_each_record
from pneumo_casadi.estimation.output_error.fit import fit_output_error
from pneumo_casadi.estimation.output_error.multistart import (
    MultiStart,
    StartOutcome,
    fit_from_many_starts,
)
from pneumo_casadi.estimation.output_error.options import (
    Method,
    OutputErrorOptions,
    narrowed_to,
)
from pneumo_casadi.estimation.output_error.result import (
    DerivedQuantity,
    FlowMapDeviation,
    OutputErrorResult,
    Stage,
)

__all__ = [
    "DerivedQuantity",
    "FlowMapDeviation",
    "Method",
    "MultiStart",
    "OutputErrorOptions",
    "OutputErrorResult",
    "RecordEstimates",
    "Stage",
    "StartOutcome",
    "fit_each_record",
    "fit_from_many_starts",
    "fit_output_error",
    "narrowed_to",
]
