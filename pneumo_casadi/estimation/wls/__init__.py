"""Weighted least squares: statistics, base parameters, the fit of the model's regressor."""

from pneumo_casadi.estimation.wls.base_parameters import (
    BaseParameters,
    base_parameters,
    structural_base,
)
from pneumo_casadi.estimation.wls.cross_validation import Prediction, cross_validate
from pneumo_casadi.estimation.wls.derived import DerivedEstimates, linear_combinations, ratios
from pneumo_casadi.estimation.wls.evaluation import evaluate_regressor
from pneumo_casadi.estimation.wls.fit import fit_wls
from pneumo_casadi.estimation.wls.linear import LinearFit, solve_wls
from pneumo_casadi.estimation.wls.linear_system import LinearSystem, stack_systems
from pneumo_casadi.estimation.wls.regressor import (
    LinearModel,
    Observation,
    StickPhases,
    observe,
)
from pneumo_casadi.estimation.wls.result import Removal, WLSResult
from pneumo_casadi.estimation.wls.table import format_table, results_table

__all__ = [
    "BaseParameters",
    "DerivedEstimates",
    "LinearFit",
    "LinearModel",
    "LinearSystem",
    "Observation",
    "Prediction",
    "Removal",
    "StickPhases",
    "WLSResult",
    "base_parameters",
    "cross_validate",
    "evaluate_regressor",
    "fit_wls",
    "format_table",
    "linear_combinations",
    "observe",
    "ratios",
    "results_table",
    "solve_wls",
    "stack_systems",
    "structural_base",
]
