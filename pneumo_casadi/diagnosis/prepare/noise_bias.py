"""A fit as it is told: its estimates less what sensor noise has moved them, with their scatter."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.errors import FitError
from pneumo_casadi.estimation.equation_error.noise_influence import estimate_noise_influence
from pneumo_casadi.model.effect import Effect

#: Bias over its standard deviation from which on the extrapolation is not relied upon.
LARGEST_BIAS = 3.0


def without_noise_bias(study: Study, fitted: FittedModel, effects: Sequence[Effect]) -> FittedModel:
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
    """
    axis = study.axis.with_effects(*effects).with_parameters(dict(fitted.values))
    try:
        influence = estimate_noise_influence(axis, study.train, study.anchor_with(effects))
    except FitError:  # what noise does to a model that noise makes diverge is not told
        return fitted
    values, stds = dict(fitted.values), dict(fitted.std)
    items = axis.parameters.select(influence.names)
    corrected = items.values - influence.bias
    large = np.abs(influence.bias) > LARGEST_BIAS * influence.std
    kept = large | (corrected <= items.lower) | (corrected >= items.upper)
    value = np.where(kept, items.values, corrected)
    std = np.where(kept, np.hypot(influence.std, influence.bias), influence.std)
    values.update(zip(influence.names, value.tolist(), strict=True))
    stds.update(zip(influence.names, std.tolist(), strict=True))
    return replace(fitted, values=values, std=stds)
