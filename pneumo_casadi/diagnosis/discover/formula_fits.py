"""Formulas fitted to a site: shapes by search, coefficients and parameters by least squares."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import minimize

from pneumo_casadi.diagnosis.discover.linear.linearised import Linearised
from pneumo_casadi.diagnosis.discover.linear.sites import Site
from pneumo_casadi.effects.term.formula import STEP_WIDTH, Formula
from pneumo_casadi.parameters import FloatArray

#: Points of the grid on which a shape is sought: positions along the driver, and widths or decays
#: as shares of its range.
POSITIONS = 17
WIDTHS = (0.03, 0.08, 0.2, 0.5)
#: Fewest periods over the range of a driver to which a sine found at two or more is refined: one
#: that ends there is a bend.
FEWEST_CYCLES = 1.5
#: Share of a constant's influence that no parameter takes up, below which it is left out.
LEAST_OBSERVABLE = 1e-3
DECAYS = (-2.0, -0.5, -0.2, -0.05, 0.05, 0.2, 0.5, 2.0)


@dataclass(frozen=True, eq=False)
class FormulaFit:
    """A formula at a site, coefficients fitted.

    Parameters
    ----------
    site : Site
        Balance, factor and driver.
    formula : Formula
        Of the driver.
    shape : mapping of str to float
        Parameters of shape.
    coefficients : (k,) array
        Of the formula's columns.
    """

    site: Site
    formula: Formula
    shape: Mapping[str, float]
    coefficients: FloatArray

    def basis(self, d: FloatArray) -> FloatArray:
        """Return the columns of the formula, (N, k)."""
        return columns_of(self.formula, self.shape, d)

    @property
    def phase_free(self) -> bool:
        """Whether the phase belongs to a record: a vibration knows nothing of when it starts."""
        return self.formula.periodic and self.site.driver == "t"

    @property
    def parameters(self) -> dict[str, float]:
        """All parameters; of a sine, amplitude and phase."""
        c = self.coefficients
        if self.formula.periodic:
            level = dict(zip(("level",), c[2:], strict=False))
            named = {
                "amplitude": float(np.hypot(c[0], c[1])),
                "phase": float(np.arctan2(c[1], c[0])),
            }
            return named | {k: float(v) for k, v in level.items()} | dict(self.shape)
        names = [name for name, _ in self.formula.linear]
        return dict(zip(names, c.tolist(), strict=True)) | dict(self.shape)


def columns_of(formula: Formula, shape: Mapping[str, float], d: FloatArray) -> FloatArray:
    """Return the columns of a formula along a driver, (N, k)."""
    with np.errstate(over="ignore"):
        columns = np.column_stack(list(formula.columns(np, d, shape)))
    return np.asarray(np.clip(columns, -1e100, 1e100))


def fit_formula(
    linear: Linearised, site: Site, formula: Formula, period: float | None = None
) -> FormulaFit | None:
    """Fit a formula beside a refit of the parameters; None where the driver stands still.

    One that repeats begins at a period, see `best_period`; without one it is not fitted.
    """
    d = linear.train.driver(site)
    if d is None:
        return None
    lower, upper = (float(value) for value in np.quantile(d, [0.002, 0.998]))
    if not upper > lower:
        return None
    if formula.periodic:
        if period is None:
            return None
        fit = refit_shape(linear, site, formula, {"period": period})
        ends = fit.shape["period"] > 0.999 * float(np.ptp(d)) / FEWEST_CYCLES
        return None if ends else fit
    if _is_absorbed_level(linear, site, formula):
        return None
    starts = _shapes(formula, lower, upper)

    def removed(shape: Mapping[str, float]) -> float:
        return _removed(linear, site, formula, shape)

    return refit_shape(linear, site, formula, max(starts, key=removed))


def _is_absorbed_level(linear: Linearised, site: Site, formula: Formula) -> bool:
    """Return whether a formula has a constant that the parameters take up: it says nothing more."""
    if not any(name == "level" for name, _ in formula.linear):
        return False
    constant = linear.train.columns(site, lambda d: np.ones((d.size, 1)))
    return bool(linear.observable(constant)[0] < LEAST_OBSERVABLE)


def _removed(linear: Linearised, site: Site, formula: Formula, shape: Mapping[str, float]) -> float:
    D = linear.train.columns(site, lambda d: columns_of(formula, shape, d))
    return linear.removed_squares(D) if np.isfinite(D).all() else 0.0


def refit_shape(
    linear: Linearised, site: Site, formula: Formula, start: Mapping[str, float]
) -> FormulaFit:
    """Let a shape go on to where most is removed, by the simplex of Nelder and Mead."""
    names = [name for name in formula.shape if name not in formula.held]
    d = linear.train.driver(site)
    assert d is not None  # sites are those of the axis
    length = float(np.ptp(d))
    shape = dict(start)
    if names:
        resolution = {"period": start.get("period", 0.0) ** 2 / length / 8}
        sizes = np.array([resolution.get(name) or 0.02 * length for name in names])
        origin = np.array([start[name] for name in names])

        def cost(z: FloatArray) -> float:
            tried = shape | dict(zip(names, (origin + z * sizes).tolist(), strict=True))
            if tried.get("width", 1.0) <= 0:
                return 0.0
            if not 0 < tried.get("period", 1e-300) <= length / FEWEST_CYCLES:
                return 0.0
            return -_removed(linear, site, formula, tried)

        simplex = np.vstack([np.zeros(len(names)), np.eye(len(names))])
        best = minimize(
            cost,
            np.zeros(len(names)),
            method="Nelder-Mead",
            options={"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-6, "maxfev": 80},
        )
        shape |= dict(zip(names, (origin + best.x * sizes).tolist(), strict=True))
    D = linear.train.columns(site, lambda d: columns_of(formula, shape, d))
    return FormulaFit(site, formula, shape, linear.coefficients(D))


def _shapes(formula: Formula, lower: float, upper: float) -> list[dict[str, float]]:
    length = upper - lower
    inside = np.linspace(lower, upper, POSITIONS + 2)[1:-1].tolist()
    choices: dict[str, Callable[[], Sequence[float]]] = {
        "vertex": lambda: inside,
        "edge": lambda: inside,
        "centre": lambda: inside,
        "width": lambda: (
            [STEP_WIDTH * length] if formula.held else [share * length for share in WIDTHS]
        ),
        "decay": lambda: [share * length for share in DECAYS],
    }
    grids = [choices[name]() for name in formula.shape]
    return [dict(zip(formula.shape, values, strict=True)) for values in product(*grids)]
