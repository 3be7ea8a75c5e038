"""Penalised B-splines over one driver, smoothness by generalised cross-validation.

P-splines of Eilers and Marx (1996, Statistical Science 11, 89-121): cubic B-splines at equal
distances with a penalty on second differences of the coefficients. The degree of smoothness is the
minimum of generalised cross-validation (Craven and Wahba 1979, Numerische Mathematik 31, 377-403).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import BSpline

from pneumo_casadi.diagnosis.discover.discovered import QUANTILE, TermCurve
from pneumo_casadi.diagnosis.discover.formula_fits import FormulaFit
from pneumo_casadi.diagnosis.discover.linear.linearised import Linearised
from pneumo_casadi.diagnosis.discover.linear.sites import Site
from pneumo_casadi.estimation.robust_covariance import batch_sandwich
from pneumo_casadi.parameters import FloatArray

#: Intervals of a curve: enough for a tenth of a stroke; finer structure that repeats is found by
#: its period.
INTERVALS = 20
DEGREE = 3
SPLINES = INTERVALS + DEGREE
#: Penalties compared, relative to the information of the columns.
PENALTIES = np.logspace(-6, 4, 21)
#: Points at which a curve is told.
POINTS = 101
#: Eigenvalue of the relative information below which the columns are absorbed by the parameters.
ABSORBED = 1e-9


@dataclass(frozen=True, eq=False)
class Curve:
    """A smooth function of the driver of a site.

    Parameters
    ----------
    site : Site
        Balance, factor and driver.
    knots : (k,) array
        Of the B-splines.
    coefficients : (n,) array
        Of the B-splines, in the unit of the term.
    """

    site: Site
    knots: FloatArray
    coefficients: FloatArray

    def basis(self, d: FloatArray) -> Any:
        """Return the B-splines at values of the driver, constant beyond the ends, (N, n)."""
        return spline_columns(self.knots, d)

    def __call__(self, d: FloatArray) -> FloatArray:
        """Return the function at values of the driver, (N,)."""
        return np.asarray(self.basis(d) @ self.coefficients)


def uniform_knots(lower: float, upper: float) -> FloatArray:
    """Return knots at equal distances, with those that cubic splines need beyond the ends."""
    step = (upper - lower) / INTERVALS
    return np.asarray(lower + step * np.arange(-DEGREE, INTERVALS + DEGREE + 1))


def spline_columns(knots: FloatArray, d: FloatArray) -> Any:
    """Return the B-splines of uniform knots, sparse (N, n)."""
    inside = np.clip(d, knots[DEGREE], knots[-DEGREE - 1])
    return BSpline.design_matrix(inside, knots, DEGREE)


def fit_curve(linear: Linearised, site: Site) -> Curve | None:
    """Fit a smooth term beside a refit of the parameters; None where the driver stands still."""
    if linear.train.driver(site) is None:
        return None
    (curve,) = fit_curves(linear, [site])
    return curve


def fit_curves(linear: Linearised, sites: Sequence[Site]) -> tuple[Curve, ...]:
    """Fit smooth terms at several sites together, one smoothness for all.

    Parameters
    ----------
    linear : Linearised
        The fit whose residuals they explain.
    sites : sequence of Site
        With drivers that vary.
    """
    knots, columns = [], []
    for site in sites:
        d = linear.train.driver(site)
        assert d is not None  # sites without a driver are left out before
        lower, upper = np.quantile(d, [0.002, 0.998])
        knots.append(uniform_knots(float(lower), float(upper)))
        columns.append(linear.train.columns(site, partial(spline_columns, knots[-1])))
    D = linear.padded(np.hstack(columns))
    c, _ = _smoothest(linear.project(D), D, linear.projected)
    parts = np.split(c, len(sites))
    return tuple(Curve(site, at, part) for site, at, part in zip(sites, knots, parts, strict=True))


def _smoothest(P: FloatArray, D: FloatArray, e: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return coefficients and penalty at the minimum of generalised cross-validation.

    Columns are blocks of as many B-splines each.
    """
    G, g, n, ee = P.T @ P, P.T @ e, P.shape[0], float(e @ e)
    # Scales by the whole influence, so that what the parameters absorb has small eigenvalues.
    scales = np.array([np.sum(D[:, i] ** 2) for i in range(D.shape[1])]).reshape(-1, SPLINES)
    scale = np.repeat(np.maximum(scales.mean(axis=1), 1e-300), SPLINES)
    second = np.diff(np.eye(SPLINES), 2, axis=0)
    R = np.kron(np.eye(len(scales)), second.T @ second) * scale
    ridge = ABSORBED * np.diag(scale)
    best = np.inf
    chosen = np.zeros(D.shape[1]), ridge
    for penalty in PENALTIES:
        whole = penalty * R + ridge
        H = np.linalg.solve(G + whole, np.column_stack([g, G]))
        c, freedom = -H[:, 0], float(np.trace(H[:, 1:]))
        squares = ee + 2 * float(c @ g) + float(c @ G @ c)
        score = squares / max(n - freedom, 1.0) ** 2
        if score < best:
            best, chosen = score, (c, whole)
    return chosen


def curve_of(linear: Linearised, fit: FormulaFit) -> TermCurve:
    """Return the term as a curve with its band, and the formula beside it.

    A formula that repeats is folded: the curve is over one period. What the parameters of the model
    take up alike (a constant, a slope) is free in both; the formula is shifted to the curve.
    """
    period = fit.shape["period"] if fit.formula.periodic else None
    d = linear.train.driver(fit.site)
    assert d is not None  # sites are those of the axis
    lower, upper = (0.0, period) if period else np.quantile(d, [0.002, 0.998]).tolist()
    knots = uniform_knots(lower, upper)

    def basis(values: FloatArray) -> Any:
        return spline_columns(knots, np.mod(values, period) if period else values)

    D = linear.padded(linear.train.columns(fit.site, basis))
    P = linear.project(D)
    c, penalty = _smoothest(P, D, linear.projected)
    inverse = np.asarray(np.linalg.inv(P.T @ P + penalty), dtype=float)
    e = linear.projected + P @ c
    n = linear.train.e.size
    covariance = batch_sandwich(inverse, [linear.train.scores(P[:n], e[:n])])
    grid = np.linspace(lower, upper, POINTS)
    B = spline_columns(knots, grid).toarray()
    value = B @ c
    band = QUANTILE * np.sqrt(np.maximum(np.sum(B * (B @ covariance), axis=1), 0.0))
    formula = fit.formula.value(np, grid, fit.parameters)
    return TermCurve(grid, value, band, formula + np.mean(value - formula))
