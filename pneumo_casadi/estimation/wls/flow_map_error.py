"""What errors of a metered flow map do to the rows of a regression."""

from typing import Any

import numpy as np

from pneumo_casadi.data import Bench
from pneumo_casadi.estimation.wls.evaluation import evaluate_along
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.signals import FilteredRecording, FilterPlan, decimated_rows

#: Directions of a covariance below this share of the largest are rounding.
TOLERANCE = 1e-12
#: Samples around a decimated row at which the flow is evaluated.
POINTS = 10


def flow_map_error(model: Any, filtered: FilteredRecording, plan: FilterPlan) -> FloatArray:
    """Return the changes of Y that errors of the flow map make, each of standard deviation one.

    The coefficients c of the map are known with a covariance C = L Lᵀ from the scatter of the
    metered points. Their errors are those of all rows at once, so that more rows do not average
    them out.

    Parameters
    ----------
    model : LinearModel
        A model without a metered map has none.
    filtered : FilteredRecording
        States and inputs.
    plan : FilterPlan
        The parallel filter of Y.

    Returns
    -------
    (ne, m, k) array
        ∂Y/∂c L, averaged around each decimated row of Y; k = 0 without a metered map.
    """
    ne, rows = len(model.equations), decimated_rows(filtered.N, plan.factor)
    bench = getattr(model, "bench", None)
    if not isinstance(bench, Bench) or not bench.valves.metered:
        return np.zeros((ne, rows.size, 0))
    L = covariance_root(model.flow.covariance)
    # A covariance needs no filter of its own: a mean over the reach of Y's is within some per cent.
    around = np.linspace(-plan.factor / 2, plan.factor / 2, min(POINTS, plan.factor))
    samples = np.clip(rows[:, None] + np.rint(around).astype(int), 0, filtered.N - 1)
    (slopes,) = evaluate_along(model.flow_slopes, model, filtered, samples.ravel())
    mean: FloatArray = slopes.reshape(ne, *samples.shape, -1).mean(axis=2)
    return mean @ L


def covariance_root(covariance: FloatArray) -> FloatArray:
    """Return L (n, k) with L Lᵀ the covariance; what is not known at all (infinite) is left out.

    Examples
    --------
    >>> covariance_root(np.diag([4.0, np.inf, 9.0])).tolist()
    [[2.0, 0.0], [0.0, 0.0], [0.0, 3.0]]
    """
    n = len(covariance)
    known = np.flatnonzero(np.isfinite(np.diag(covariance)))
    size = np.sqrt(np.diag(covariance))[known]
    size = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(covariance[np.ix_(known, known)] / np.outer(size, size))
    strong = values > TOLERANCE * max(float(values.max(initial=0.0)), 1e-300)
    L = np.zeros((n, int(strong.sum())))
    L[known] = size[:, None] * vectors[:, strong] * np.sqrt(values[strong])
    return L
