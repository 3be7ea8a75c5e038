"""Weighted least squares: statistics, base parameters, the fit of the model's regressor."""

from pneumo_casadi.regression.base_parameters import (
    BaseParameters,
    base_parameters,
    structural_base,
)
from pneumo_casadi.regression.cross_validation import Prediction, cross_validate
from pneumo_casadi.regression.derived import Derived, linear_combinations, ratios
from pneumo_casadi.regression.linear import LinearFit, LinearSystem, solve_wls, stack_systems
from pneumo_casadi.regression.observation import (
    LinearModel,
    Observation,
    Stick,
    evaluate_regressor,
    observe,
)
from pneumo_casadi.regression.result import Removal, WLSResult
from pneumo_casadi.regression.table import format_table, results_table
from pneumo_casadi.regression.wls import fit_wls

__all__ = [
    "BaseParameters",
    "Derived",
    "LinearFit",
    "LinearModel",
    "LinearSystem",
    "Observation",
    "Prediction",
    "Removal",
    "Stick",
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
