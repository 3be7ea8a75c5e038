"""Output error for effects of sensors, which the measured motion does not show, and beside them.

While a play is crossed, the sensor stands still and the piston moves: no smoothing brings that
motion back, only a simulation does.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pneumo_casadi.diagnosis.metrics.simulated_fit import V_S_SIMULATED, WINDOW
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.fit import default_residual_floor
from pneumo_casadi.estimation.equation_error.problem import Problem
from pneumo_casadi.estimation.equation_error.residuals import balance_residuals
from pneumo_casadi.estimation.output_error import (
    OutputErrorOptions,
    OutputErrorResult,
    fit_output_error,
)
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.model.stepping import COARSE

#: Iterations of a refinement.
MAX_ITERATIONS = 30
OPTIONS = OutputErrorOptions(
    window=WINDOW, widths=(V_S_SIMULATED,), recover=False, longest_step=COARSE
)


def refine_by_output_error(
    study: Study,
    fitted: FittedModel,
    effects: Sequence[Effect],
    iterations: int = MAX_ITERATIONS,
) -> FittedModel:
    """Refine a fit by output error over windows; its values stay as they were where that fails.

    The flow map is held where the balances have left it: windows of half a second say little of
    it, and the gauge stays where it is.
    """
    axis = study.axis.with_effects(*effects).with_parameters(dict(fitted.values))
    if axis.kind.needs_flow_map:
        metered = [f"{e.name}.{p.name}" for e in effects if e.metered for p in e.parameters]
        fixed = (*axis.flow_parameters, *metered)
        axis = axis.with_parameters(axis.parameters.fix(*fixed))
    result: object
    try:
        result = fit_output_error(
            axis, study.train, None, replace(OPTIONS, max_iterations=iterations)
        )
    except FitError as error:
        result = error.partial
    except ModelError:
        result = None
    if not isinstance(result, OutputErrorResult) or not np.isfinite(result.rms).all():
        return _in_balances(study, fitted, effects)
    values = result.parameters.as_dict() | {"v_s": fitted.values["v_s"]}
    std = {name: result.std(name, robust=True) for name in result.uncertainty.names}
    known = {**fitted.std, **{k: v for k, v in std.items() if np.isfinite(v)}}
    return _in_balances(study, replace(fitted, values=values, std=known), effects)


def _in_balances(study: Study, fitted: FittedModel, effects: Sequence[Effect]) -> FittedModel:
    """Return a fit with the residuals and the cost that the balances have at its values."""
    model = BalanceFunctions(study.axis.with_effects(*effects).with_parameters(dict(fitted.values)))
    theta, anchor = model.axis.parameters.values, study.anchor_with(effects)
    problem = Problem(model, study.smoothed[0], anchor, default_residual_floor(study.axis), False)
    train = problem.residuals(theta)
    held_out = tuple(balance_residuals(model, data, theta) for data in study.smoothed[1])
    return replace(
        fitted, cost=problem.cost(train, theta), train=train, held_out=held_out, pace=0.0
    )
