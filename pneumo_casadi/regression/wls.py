"""Weighted least squares on the model's regressor (section 4 of the paper)."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.filtering import FilterPlan, InputPairing, plan_for
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.recording import Recording
from pneumo_casadi.regression.base_parameters import BaseParameters
from pneumo_casadi.regression.derived import Derived, ratios
from pneumo_casadi.regression.linear import (
    LinearFit,
    LinearSystem,
    relative_error_percent,
    solve_wls,
    stack_systems,
)
from pneumo_casadi.regression.observation import LinearModel, Observation, Stick, observe

#: Polytropic coefficients as ratios of parameters (eq. 10 and 11).
POLYTROPIC: Mapping[str, tuple[str, str]] = {
    "k_P": ("X_s3", "X_s2"),
    "k_N": ("X_s6", "X_s5"),
}


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


@dataclass(frozen=True, slots=True, eq=False)
class WLSResult:
    """What weighted least squares found, with its statistics.

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
    stick : Stick
        Treatment of samples at rest.
    velocity_threshold : mapping of str to float
        Per record, below which a sample counts as at rest [m/s].
    rows_dropped : mapping of str to int
        Decimated rows of each equation that were left out.
    samples_dropped : mapping of str to (int, int)
        Per record, raw samples dropped at front and back for the edges of the filter.
    derived : Derived or None
        Polytropic coefficients k_P and k_N, where the axis has chambers.
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
    stick: Stick
    velocity_threshold: Mapping[str, float]
    rows_dropped: Mapping[str, int]
    samples_dropped: Mapping[str, tuple[int, int]]
    derived: Derived | None
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
        """Covariance that allows for correlated residuals, shape (n, n)."""
        return self.fit.covariance_hac

    @property
    def std(self) -> FloatArray:
        """Standard deviations by eq. 16, shape (n,)."""
        return self.fit.std

    @property
    def std_hac(self) -> FloatArray:
        """Standard deviations that allow for correlated residuals, shape (n,)."""
        return self.fit.std_hac

    @property
    def two_sigma(self) -> FloatArray:
        """Half widths of the 95 % intervals as the paper prints them, shape (n,)."""
        return 2 * self.fit.std

    @property
    def relative_std_percent(self) -> FloatArray:
        """100 σ / |X̂| (eq. 17), shape (n,)."""
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
        return _total_error(self.fit)

    @property
    def rows_used(self) -> Mapping[str, int]:
        """Decimated rows used of each equation."""
        return self.fit.rows

    @property
    def base(self) -> BaseParameters:
        """Base parameters of the observation matrix."""
        return self.fit.base


def fit_wls(
    model: LinearModel,
    records: Recording | Iterable[Recording],
    *,
    names: Sequence[str] | None = None,
    plan: FilterPlan | None = None,
    stick: Stick = Stick.OMIT,
    velocity_threshold: float | None = None,
    pairing: InputPairing | None = None,
    equation_std: Mapping[str, float] | None = None,
    remove_above: float | None = None,
) -> WLSResult:
    r"""Estimate the parameters in which a model's balances are linear (eq. 13-17).

    .. math:: Y = W X_s + \rho, \qquad
              \hat X_s = \arg\min \sum_e \lVert \rho_e \rVert^2 / \sigma_e^2

    Parameters
    ----------
    model : LinearModel
        A `Servosystem` or `ForceAxis`; its regressor is derived from its balances.
    records : Recording or iterable of Recording
        All are used together.
    names : sequence of str, optional
        Parameters to estimate; by default all free ones that enter linearly.
    plan : FilterPlan, optional
        Both filters; by default planned from the records (`plan_for`).
    stick : Stick, optional
        Treatment of samples at rest in the force balance.
    velocity_threshold : float, optional
        Below it a sample counts as at rest [m/s]; by default tied to the velocity's noise.
    pairing : InputPairing, optional
        By default what each recording's input hold asks for.
    equation_std : mapping of str to float, optional
        Residual standard deviations of the equations; by default those of a first solution.
    remove_above : float, optional
        Remove parameters with %σ_r of at least this, for example 10, the worst first, one at a
        time; each is listed in the result. By default none is removed.

    Returns
    -------
    WLSResult

    Raises
    ------
    FitError
        If the observation matrix is rank deficient; the message names what can be estimated.
    CaseError
        If a record lacks a channel or is too short for the filters.
    """
    recordings = (records,) if isinstance(records, Recording) else tuple(records)
    if not recordings:
        raise ModelError("no record to fit")
    chosen = tuple(names) if names is not None else tuple(model.regressor_names)
    plan = plan or plan_for(recordings)
    observations = [
        observe(model, rec, chosen, plan, velocity_threshold=velocity_threshold, pairing=pairing)
        for rec in recordings
    ]
    system = stack_systems([observation.system(stick) for observation in observations])
    fit, removed = _fit_and_remove(system, equation_std, remove_above)
    parameters, outside = _at_estimates(model.parameters.select(fit.names), fit.estimate)
    total = sum(observation.t.size for observation in observations)
    return WLSResult(
        parameters=parameters,
        fit=fit,
        removed=removed,
        out_of_bounds=outside,
        plan=plan,
        stick=stick,
        velocity_threshold={o.source: o.velocity_threshold for o in observations},
        rows_dropped={name: total - used for name, used in fit.rows.items()},
        samples_dropped={o.source: o.dropped for o in observations},
        derived=_polytropic(fit),
        model=model,
        pairing=pairing,
    )


def _fit_and_remove(
    system: LinearSystem, equation_std: Mapping[str, float] | None, limit: float | None
) -> tuple[LinearFit, tuple[Removal, ...]]:
    fit = solve_wls(system, equation_std=equation_std)
    removed: list[Removal] = []
    while limit is not None:
        relative = fit.relative_std_percent
        worst = int(np.argmax(relative))
        if relative[worst] < limit:
            break
        if len(fit.names) == 1:
            raise FitError(
                f"no parameter has a relative standard deviation below {limit:g} %: "
                "the record identifies nothing",
                partial=fit,
            )
        name = fit.names[worst]
        system = system.without(name)
        smaller = solve_wls(system, equation_std=equation_std)
        removed.append(
            Removal(
                name,
                float(fit.estimate[worst]),
                float(relative[worst]),
                _total_error(fit),
                _total_error(smaller),
            )
        )
        fit = smaller
    return fit, tuple(removed)


def _total_error(fit: LinearFit) -> float:
    """Return 100 ‖ρ‖ / ‖Y‖ over all rows, in the weights of the fit."""
    shares = np.array([fit.relative_error_percent[name] for name in fit.residual_std]) / 100
    # ‖ρ_e‖² / σ_e² is the number of rows, up to the few degrees of freedom of the fit.
    squares = np.array([fit.rows[name] for name in fit.residual_std], dtype=float)
    return 100 * float(np.sqrt(squares.sum() / np.sum(squares / shares**2)))


def _at_estimates(
    parameters: Parameters, estimate: FloatArray
) -> tuple[Parameters, tuple[str, ...]]:
    items = []
    outside = []
    for item, value in zip(parameters, map(float, estimate), strict=True):
        if not item.lower <= value <= item.upper:
            outside.append(item.name)
        lower, upper = min(item.lower, value), max(item.upper, value)
        items.append(replace(item, value=value, lower=lower, upper=upper))
    return Parameters(items), tuple(outside)


def _polytropic(fit: LinearFit) -> Derived | None:
    known = {
        name: pair for name, pair in POLYTROPIC.items() if all(part in fit.names for part in pair)
    }
    return ratios(fit, known) if known else None


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Measured and predicted sides of the balances on one record (Figs. 4 and 5).

    Parameters
    ----------
    name : str
        Of the record.
    t : (m,) array
        Instants of the decimated rows [s].
    measured, predicted : mapping of str to (m,) array
        By equation: ``mass_flow_P``, ``mass_flow_N`` [kg/s], ``force`` [N].
    used : mapping of str to (m,) array of bool
        Rows that count, by the treatment of samples at rest.
    relative_error_percent : mapping of str to float
        100 ‖measured - predicted‖ / ‖measured‖ over the rows that count.
    relative_error_percent_all : mapping of str to float
        Over all rows, those at rest included.
    """

    name: str
    t: FloatArray
    measured: Mapping[str, FloatArray]
    predicted: Mapping[str, FloatArray]
    used: Mapping[str, FloatArray]
    relative_error_percent: Mapping[str, float]
    relative_error_percent_all: Mapping[str, float]


def cross_validate(
    result: WLSResult, records: Recording | Iterable[Recording]
) -> tuple[Prediction, ...]:
    """Predict flows and effort on records that were not used, and compare (Figs. 4 and 5).

    Parameters
    ----------
    result : WLSResult
        Supplies estimates, filters and treatment of samples at rest.
    records : Recording or iterable of Recording
        Best not those of the fit.

    Returns
    -------
    tuple of Prediction
        One for each record.
    """
    recordings = (records,) if isinstance(records, Recording) else tuple(records)
    return tuple(_predict(result, rec) for rec in recordings)


def _predict(result: WLSResult, recording: Recording) -> Prediction:
    o: Observation = observe(
        result.model, recording, result.names, result.plan, pairing=result.pairing
    )
    predicted = o.W @ result.estimate
    used = o.weights(result.stick) > 0
    rho = o.Y - predicted
    names = o.equations
    return Prediction(
        name=recording.name,
        t=o.t,
        measured=dict(zip(names, o.Y, strict=True)),
        predicted=dict(zip(names, predicted, strict=True)),
        used=dict(zip(names, used, strict=True)),
        relative_error_percent={
            name: relative_error_percent(rho[e, used[e]], o.Y[e, used[e]])
            for e, name in enumerate(names)
        },
        relative_error_percent_all={
            name: relative_error_percent(rho[e], o.Y[e]) for e, name in enumerate(names)
        },
    )
