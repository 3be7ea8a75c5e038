"""A formula fitted together with all parameters of the model, and its robust covariance.

The linearisation of the search is repeated at the parameters that it leads to: two or three
Gauss-Newton steps, since the term is added to the balances and changes none of their derivatives.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneumo_casadi.diagnosis.discover.formula_fits import FormulaFit, refit_shape
from pneumo_casadi.diagnosis.discover.linear.linearised import Linearised, linearise, longest
from pneumo_casadi.diagnosis.discover.linear.rows import Rows
from pneumo_casadi.diagnosis.discover.search import predicted_by
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.estimation.robust_covariance import batch_sandwich
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import FloatArray

#: Gauss-Newton steps at most, and the change of the residuals, in units of their root mean square,
#: below which they have settled: a thousandth moves no figure that is told.
STEPS, SETTLED = 6, 1e-3
#: Step of difference quotients, relative to a parameter of shape.
DIFFERENCE = 1e-5


@dataclass(frozen=True, eq=False)
class JointFit:
    """A model with a term, both fitted together.

    Parameters
    ----------
    model : FittedModel
        Parameters of the model; its residuals are those with the term.
    fit : FormulaFit
        The term.
    std : mapping of str to float
        Robust standard deviations of the term's parameters [SI].
    linear : Linearised
        The model without the term, linearised at these parameters.
    """

    model: FittedModel
    fit: FormulaFit
    std: Mapping[str, float]
    linear: Linearised


def fit_jointly(
    study: Study, base: FittedModel, effects: Sequence[Effect], fit: FormulaFit
) -> JointFit:
    """Fit a term and all free parameters of a model together.

    Parameters
    ----------
    study : Study
        The case.
    base : FittedModel
        Where the model's parameters begin.
    effects : sequence of Effect
        Of the model.
    fit : FormulaFit
        Where the term begins.
    """
    model = base
    for _ in range(STEPS):
        linear = linearise(study, model, effects)
        fit = refit_shape(linear, fit.site, fit.formula, fit.shape)
        D = linear.train.columns(fit.site, fit.basis) @ fit.coefficients
        step = linear.parameter_change(linear.e + np.append(D, np.zeros(linear.e_map.size)))
        values = _stepped(study, effects, model, linear, step)
        if np.sqrt(np.mean((linear.train.A @ step) ** 2)) < SETTLED:
            break
        train, held_out = predicted_by(linear, fit)
        model = replace(
            model,
            values=values,
            train=linear.train.unweighted(train),
            held_out=linear.held_out.unweighted(held_out),
        )
    else:  # not settled: what is told belongs to where the last step has led
        linear = linearise(study, model, effects)
    train, held_out = predicted_by(linear, fit, refitted=False)
    model = replace(
        model,
        train=linear.train.unweighted(train),
        held_out=linear.held_out.unweighted(held_out),
    )
    return JointFit(model, fit, _robust_std(linear, fit), linear)


def in_longest_record(study: Study, fitted: FittedModel) -> tuple[Study, FittedModel]:
    """Return a study and its fit with the longest of the records fitted alone."""
    if len(study.train) == 1:
        return study, fitted
    i = longest(study.smoothed[0])
    part = slice(i, i + 1)
    alone = replace(fitted, train=fitted.train[part], used_train=fitted.used_train[part])
    return replace(study, train=study.train[part]), alone


def _stepped(
    study: Study,
    effects: Sequence[Effect],
    model: FittedModel,
    linear: Linearised,
    step: FloatArray,
) -> dict[str, float]:
    """Return the parameters after a scaled step, within their bounds."""
    items = study.axis.with_effects(*effects).parameters.select(linear.names)
    before = np.array([model.values[name] for name in linear.names])
    after = np.clip(before + step * linear.scales, items.lower, items.upper)
    return {**model.values, **dict(zip(linear.names, after.tolist(), strict=True))}


def _robust_std(linear: Linearised, fit: FormulaFit) -> dict[str, float]:
    """Return standard deviations of the term's parameters, robust to correlated residuals."""
    names = [name for name in fit.formula.parameters if name not in fit.formula.held]
    slopes = linear.padded(_derivatives(linear.train, fit, names))
    J = np.hstack([np.vstack([linear.train.A, linear.A_map]), slopes])
    size = np.maximum(np.linalg.norm(J, axis=0), 1e-300)
    J = J / size
    inverse = np.linalg.pinv(J.T @ J, rcond=1e-12, hermitian=True)
    train, _ = predicted_by(linear, fit)
    scores = linear.train.scores(J[: train.size], train)
    sources: list[list[FloatArray]] = [scores]
    if linear.e_map.size:
        sources.append([J[train.size :] * linear.e_map[:, None]])
    covariance = batch_sandwich(inverse, sources)
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))[-len(names) :] / size[-len(names) :]
    return dict(zip(names, std.tolist(), strict=True))


def _derivatives(rows: Rows, fit: FormulaFit, names: Sequence[str]) -> FloatArray:
    """Return derivatives of the weighted residuals to the term's parameters, (r, k)."""
    at = fit.parameters

    def basis(d: FloatArray) -> FloatArray:
        columns = []
        for name in names:
            h = DIFFERENCE * (abs(at[name]) or 1.0)
            ends = (fit.formula.value(np, d, at | {name: at[name] + s * h}) for s in (1, -1))
            above, below = ends
            columns.append((above - below) / (2 * h))
        return np.column_stack(columns)

    return rows.columns(fit.site, basis)
