"""Equation error: parameters from the residuals of the balances along the smoothed motion."""

from pneumo_casadi.estimation.equation_error.fit import default_residual_floor, fit_equation_error
from pneumo_casadi.estimation.equation_error.noise_influence import (
    NoiseInfluence,
    estimate_noise_influence,
)
from pneumo_casadi.estimation.equation_error.result import EquationErrorResult
from pneumo_casadi.estimation.equation_error.smoothed_motion import (
    SmoothedMotion,
    smooth_motion,
    smooth_motions,
)

__all__ = [
    "EquationErrorResult",
    "NoiseInfluence",
    "SmoothedMotion",
    "default_residual_floor",
    "estimate_noise_influence",
    "fit_equation_error",
    "smooth_motion",
    "smooth_motions",
]
