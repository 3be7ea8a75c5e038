"""A fit as it is told: its estimates less what sensor noise has moved them, with their scatter."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.errors import FitError
from pneumo_casadi.estimation.equation_error.noise_influence import estimate_noise_influence
from pneumo_casadi.model.effect import Effect

#: Bias over its standard deviation from which on the extrapolation is not relied upon.
LARGEST_BIAS = 3.0


def without_noise_bias(
    study: Study,
    fitted: FittedModel,
    effects: Sequence[Effect],
    executor: Executor | None = None,
) -> FittedModel:
    """Return a fit with estimates less their bias by sensor noise and robust standard deviations.

    A value with a large bias, or that would leave its bounds, is kept, and its standard deviation
    contains the bias. Residuals stay those of the fit: what is told of a gap is what the fit has
    left. Fits are compared as they are, because the bias of one hardly differs from that of the
    next.

    Parameters
    ----------
    study : Study
        Its records were fitted.
    fitted : FittedModel
        From `fit_model`.
    effects : sequence of Effect
        Of the model.
    executor : Executor, optional
        Where noise is added to the records; by default in this process.
    """
    axis = study.axis.with_effects(*effects).with_parameters(dict(fitted.values))
    released = [name for name in fitted.std if name not in axis.parameters.free_names]
    axis = axis.with_parameters(axis.parameters.release(*released))
    try:
        influence = estimate_noise_influence(
            axis, study.train, study.anchor_with(effects), executor
        )
    except FitError:  # what noise does to a model that noise makes diverge is not told
        return fitted
    values, stds = dict(fitted.values), dict(fitted.std)
    items = axis.parameters.select(influence.names)
    corrected = items.values - influence.bias
    small = np.abs(influence.bias) <= LARGEST_BIAS * influence.std
    moved = small & (corrected > items.lower) & (corrected < items.upper)
    value = np.where(moved, corrected, items.values)
    std = np.where(moved, influence.std, np.hypot(influence.std, influence.bias))
    for i in np.flatnonzero(np.isfinite(std)):
        values[influence.names[i]], stds[influence.names[i]] = float(value[i]), float(std[i])
    return replace(fitted, values=values, std=stds)
