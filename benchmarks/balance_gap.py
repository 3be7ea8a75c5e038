"""Fits of the balances for benchmarks: seconds a case, where output error needs minutes.

One rule for every fit. The nominal axis is fitted to the balances along the smoothed motion; an
effect is added to that fit, its shapes begun where the diagnosis would begin them; an effect of a
sensor is then refined by output error over windows, because the measured motion does not show it.
"""

import math
from typing import Any

import numpy as np
from gap import finite, gaps

from pneumo_casadi.data import Case
from pneumo_casadi.diagnosis.metrics.simulated_fit import V_S_SIMULATED
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel, fit_model
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.screen.background import background
from pneumo_casadi.diagnosis.screen.directions import perturbation
from pneumo_casadi.diagnosis.screen.screen import screened
from pneumo_casadi.diagnosis.select.output_error_refinement import refine_by_output_error
from pneumo_casadi.estimation.equation_error.balance_functions import any_sensor_effect
from pneumo_casadi.model.effect import Effect

#: Parameters of the nominal axis that an effect may move.
MOVABLE = (*(f"X_s{i}" for i in range(1, 7)), "M", "f_v", "F_c_plus", "F_c_minus")


def refit(study: Study, before: FittedModel, effect: Effect) -> FittedModel:
    """Add an effect to the nominal fit."""
    directions = perturbation(study, before, effect)
    starts = screened(effect.name, directions, background(study, before, before)).starts
    fitted = fit_model(study, (effect,), before.values, starts, before.cost)
    return (
        refine_by_output_error(study, fitted, (effect,)) if any_sensor_effect((effect,)) else fitted
    )


def simulated_gaps(
    study: Study, fitted: FittedModel, case: Case, *effects: Effect
) -> dict[str, Any] | None:
    """Return the gaps of a fit on the held-out record; None where no simulation is finite."""
    axis = study.axis.with_effects(*effects).with_parameters(dict(fitted.values))
    return gaps(axis.with_parameters({"v_s": V_S_SIMULATED}), case)


def told(study: Study, fitted: FittedModel) -> dict[str, Any]:
    """Return what is told of a fit besides its gap."""
    names = [n for n in fitted.values if n in MOVABLE or "." in n]
    return {
        "failure": None if fitted.converged else "the fit of the balances has not settled",
        "parameters": {name: fitted.values[name] for name in names},
        "std": {name: finite(fitted.std.get(name, math.inf)) for name in names},
        "map_pull": _map_pull(study, fitted),
    }


def _map_pull(study: Study, fitted: FittedModel) -> float | None:
    """Return the rms of the flow map's residuals at the metered points."""
    if study.anchor is None:
        return None
    r = study.anchor(np.array([fitted.values[name] for name in study.anchor.names]))
    return float(np.sqrt(np.mean(r**2)))
