"""Result of weighted least squares: estimates with statistics, and how they were obtained."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from pneumo_casadi.estimation.wls.base_parameters import BaseParameters
from pneumo_casadi.estimation.wls.derived import DerivedEstimates
from pneumo_casadi.estimation.wls.linear import LinearFit
from pneumo_casadi.estimation.wls.regressor import LinearModel, StickPhases
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.runtime.presentation import Presentable
from pneumo_casadi.signals import FilterPlan, InputPairing


@dataclass(frozen=True, slots=True)
class Removal:
    """A parameter that was removed from the regression, and thereby put to zero.

    Parameters
    ----------
    name : str
        The parameter.
    value, relative_std_percent : float
        Its estimate and %σ_r when it was removed.
    error_before, error_after : float
        Relative error of all equations together, in per cent, with it and without it.
    """

    name: str
    value: float
    relative_std_percent: float
    error_before: float
    error_after: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class WLSResult(Presentable):
    """Estimates of weighted least squares with their statistics.

    There are two covariances. `covariance` is eq. 16 of the paper, right if the decimated residuals
    are white and the flow map is exact. `covariance_hac` allows for the correlation that the
    filters and unmodelled effects leave in the residuals, and contains the noise of the flow map;
    reports print its intervals.

    Parameters
    ----------
    parameters : Parameters
        The estimated parameters at their estimates. Least squares knows no bounds: where an
        estimate violates one, the bound is moved and the name is in `out_of_bounds`.
    fit : LinearFit
        Estimate, covariances, residuals, base parameters.
    removed : tuple of Removal
        Parameters removed on request, in order.
    out_of_bounds : tuple of str
        Estimates that the physics excludes.
    plan : FilterPlan
        Both filters.
    stick : StickPhases
        Treatment of samples at rest.
    velocity_threshold : mapping of str to float
        Per record, below which a sample counts as at rest [m/s].
    rows_dropped : mapping of str to int
        Decimated rows of each equation that were left out.
    samples_dropped : mapping of str to (int, int)
        Per record, raw samples dropped at front and back for the edges of the filter.
    derived : DerivedEstimates or None
        Polytropic coefficients k_P and k_N by `covariance_hac`, where the axis has chambers.
    model : LinearModel
        Whose regressor was used.
    pairing : InputPairing or None
        As asked for.
    """

    parameters: Parameters
    fit: LinearFit
    removed: tuple[Removal, ...]
    out_of_bounds: tuple[str, ...]
    plan: FilterPlan
    stick: StickPhases
    velocity_threshold: Mapping[str, float]
    rows_dropped: Mapping[str, int]
    samples_dropped: Mapping[str, tuple[int, int]]
    derived: DerivedEstimates | None
    model: LinearModel = field(repr=False)
    pairing: InputPairing | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Estimated parameters, in order."""
        return self.fit.names

    @property
    def estimate(self) -> FloatArray:
        """X̂, shape (n,)."""
        return self.fit.estimate

    @property
    def covariance(self) -> FloatArray:
        """Eq. 16, shape (n, n)."""
        return self.fit.covariance

    @property
    def covariance_hac(self) -> FloatArray:
        """Covariance for correlated residuals and a noisy flow map, shape (n, n)."""
        return self.fit.covariance_hac

    @property
    def std(self) -> FloatArray:
        """Standard deviations by eq. 16, shape (n,)."""
        return self.fit.std

    @property
    def std_hac(self) -> FloatArray:
        """Standard deviations for correlated residuals and a noisy flow map, shape (n,)."""
        return self.fit.std_hac

    @property
    def two_sigma(self) -> FloatArray:
        """Half widths of the 95 % intervals as the paper prints them, shape (n,)."""
        return 2 * self.fit.std

    @property
    def relative_std_percent(self) -> FloatArray:
        """100 σ / ``|X̂|`` (eq. 17), shape (n,)."""
        return self.fit.relative_std_percent

    @property
    def condition_number(self) -> float:
        """Of the weighted observation matrix with columns of unit length."""
        return self.fit.condition_number

    @property
    def relative_error_percent(self) -> Mapping[str, float]:
        """100 ‖ρ‖ / ‖Y‖ of each equation, over the rows used."""
        return self.fit.relative_error_percent

    @property
    def total_error_percent(self) -> float:
        """The same over all equations, each weighted with its residual's deviation."""
        return total_error_percent(self.fit)

    @property
    def rows_used(self) -> Mapping[str, int]:
        """Decimated rows used of each equation."""
        return self.fit.rows

    @property
    def base(self) -> BaseParameters:
        """Base parameters of the observation matrix."""
        return self.fit.base

    @property
    def headline(self) -> str:
        """Parameters, rows, condition number and relative error."""
        return (
            f"Weighted least squares: {len(self.names)} parameters from "
            f"{sum(self.rows_used.values())} rows, condition number {self.condition_number:.3g}, "
            f"relative error {self.total_error_percent:.3g} %"
        )

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter: estimate, both standard deviations [SI] and %σ_r."""
        columns = {
            "estimate": self.estimate,
            "std": self.std,
            "std_hac": self.std_hac,
            "relative_std_percent": self.relative_std_percent,
            "unit": list(self.parameters.units),
        }
        return pd.DataFrame(columns, index=pd.Index(self.names, name="parameter"))

    def as_dict(self) -> dict[str, Any]:
        """Return parameters, derived quantities and errors as plain values, ready for JSON."""
        columns = (self.std, self.std_hac, self.relative_std_percent)
        return {
            "parameters": {
                item.name: {
                    "value": item.value,
                    "std": float(std),
                    "std_hac": float(std_hac),
                    "relative_std_percent": float(relative),
                    "unit": item.unit,
                }
                for item, std, std_hac, relative in zip(self.parameters, *columns, strict=True)
            },
            "derived": {} if self.derived is None else self.derived.as_dict(),
            "condition_number": self.condition_number,
            "relative_error_percent": dict(self.relative_error_percent),
            "rows_used": dict(self.rows_used),
            "rows_dropped": dict(self.rows_dropped),
            "removed": [item.name for item in self.removed],
            "out_of_bounds": list(self.out_of_bounds),
        }


def total_error_percent(fit: LinearFit) -> float:
    """Return 100 ‖ρ‖ / ‖Y‖ over all rows, in the weights of the fit."""
    shares = np.array([fit.relative_error_percent[name] for name in fit.residual_std]) / 100
    # ‖ρ_e‖² / σ_e² is the number of rows, up to the few degrees of freedom of the fit.
    squares = np.array([fit.rows[name] for name in fit.residual_std], dtype=float)
    return 100 * float(np.sqrt(squares.sum() / np.sum(squares / shares**2)))
