"""What a refit of a model would absorb, and the residuals that it leaves."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.screen.directions import Direction, row_weights
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.problem import prior_rows
from pneumo_casadi.estimation.equation_error.residuals import linearise_residuals
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import FloatArray


@dataclass(frozen=True, eq=False)
class Background:
    """Residuals at a fit and a basis of what a refit would absorb.

    Those of the flow map are the last, and behind them those of the priors of its effects.

    Parameters
    ----------
    e : (rows,) array
        Residuals over the standard deviation that the fit leaves in their balance.
    Q : (rows, n) array
        Orthonormal.
    weight : (rows,) array
        By which the rows of a `Direction`, weighted as the nominal fit, are weighted as this one.
    of_balance : (ne, rows) array of bool
        Which rows belong to each balance.
    """

    e: FloatArray
    Q: FloatArray
    weight: FloatArray
    of_balance: NDArray[np.bool_]

    def weighted(self, direction: Direction) -> FloatArray:
        """Return the columns of a direction in these rows, zero in those of priors, (rows, k)."""
        missing = len(self.e) - len(direction.columns)
        return np.pad(direction.columns, ((0, missing), (0, 0))) * self.weight[:, None]


def background(
    study: Study, nominal: FittedModel, fitted: FittedModel, effects: Sequence[Effect] = ()
) -> Background:
    """Linearise a fit and return its residuals with the space that a refit would absorb.

    Weighted by what the fit leaves: beside a large effect that was found, a small one counts by
    what is left. Half the squares that it takes away are then the log-likelihood that it gains.
    """
    axis = study.axis.with_effects(*effects).with_parameters(dict(fitted.values))
    model = BalanceFunctions(axis)
    theta = axis.parameters.values
    r, J, balance = [], [], []
    for data in study.smoothed[0]:
        linear, mask = linearise_residuals(model, data, theta), data.used(axis)
        balance.append(np.nonzero(mask)[0])
        r.append(linear.r[mask])
        J.append(linear.J[mask])
    weight = row_weights(study, fitted)
    relative = row_weights(study, nominal) / weight
    scales = axis.parameters.select(model.free).scales
    A = np.concatenate(J) * scales / weight[:, None]
    e = np.concatenate(r) / weight
    known = study.anchor_with(effects)
    if known is not None:
        c = known.coefficients(axis.parameters, theta)
        A = np.vstack([A, known.rows(c, model.free) * scales])
        e = np.concatenate([e, known(c)])
    prior = prior_rows(axis)
    free = [axis.parameters.index(name) for name in model.free]
    A = np.vstack([A, prior[:, free] * scales])
    e = np.concatenate([e, prior @ theta])
    relative = np.concatenate([relative, np.ones(len(e) - len(relative))])
    size = np.linalg.norm(A, axis=0)
    U, s, _ = np.linalg.svd(A / np.where(size > 0, size, 1.0), full_matrices=False)
    of_balance = np.zeros((len(axis.equations), len(e)), dtype=bool)
    which = np.concatenate(balance)
    of_balance[which, np.arange(len(which))] = True
    return Background(e, U[:, s > 1e-9 * s[0]], relative, of_balance)


def lost_likelihood(whole: Background, without: Background) -> float:
    """Return the log-likelihood that a fit loses without an effect, to second order.

    The other effects keep their values but for what a refit would absorb.
    """
    e = without.e - without.Q @ (without.Q.T @ without.e)
    return 0.5 * float(e @ e - whole.e @ whole.e)
