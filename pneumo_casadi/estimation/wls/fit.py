"""Weighted least squares on the model's regressor (section 4 of the paper)."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from pneumo_casadi.data import Recording
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.flow_scale import flow_scale_covariance
from pneumo_casadi.estimation.wls.derived import DerivedEstimates, ratios
from pneumo_casadi.estimation.wls.linear import LinearFit, solve_wls
from pneumo_casadi.estimation.wls.linear_system import LinearSystem, stack_systems
from pneumo_casadi.estimation.wls.regressor import LinearModel, Observation, StickPhases, observe
from pneumo_casadi.estimation.wls.result import Removal, WLSResult, total_error_percent
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.signals import FilterPlan, InputPairing, plan_filters_for

_T = TypeVar("_T")

#: Polytropic coefficients as ratios of parameters (eq. 10 and 11).
POLYTROPIC: Mapping[str, tuple[str, str]] = {
    "k_P": ("X_s3", "X_s2"),
    "k_N": ("X_s6", "X_s5"),
}


def fit_wls(
    model: LinearModel,
    records: Recording | Iterable[Recording],
    *,
    names: Sequence[str] | None = None,
    plan: FilterPlan | None = None,
    stick: StickPhases = StickPhases.OMIT,
    velocity_threshold: float | None = None,
    pairing: InputPairing | None = None,
    equation_std: Mapping[str, float] | None = None,
    remove_above: float | None = None,
) -> WLSResult:
    r"""Estimate the parameters in which a model's balances are linear (eq. 13-17).

    .. math:: Y = W X_s + \rho, \qquad
              \hat X_s = \arg\min \sum_e \lVert \rho_e \rVert^2 / \sigma_e^2

    Y and W are the filtered and decimated terms of the balances, W with one column per parameter.
    X_s (n,) are the parameters. ρ_e are the residuals of equation e (a mass flow balance [kg/s] or
    the force balance [N]) and σ_e their standard deviation. Eq. 17 gives the relative standard
    deviation of a parameter, %σ_r = 100 σ/\|X̂_s\| [%].

    Parameters
    ----------
    model : LinearModel
        A `Servosystem` or `ForceAxis`; its regressor is derived from its balances.
    records : Recording or iterable of Recording
        All are used together.
    names : sequence of str, optional
        Names of the parameters to estimate, such as ``"X_s1"`` and ``"M"``; by default all free
        parameters in which the balances are linear.
    plan : FilterPlan, optional
        Both filters; by default planned from the records (`plan_filters_for`).
    stick : StickPhases, optional
        Treatment of samples at rest in the force balance.
    velocity_threshold : float, optional
        Speed below which a sample counts as at rest [m/s]; by default 5 standard deviations of the
        noise of the filtered velocity, and at least 0.2 % of the largest speed.
    pairing : InputPairing, optional
        Which input is paired with the derivative at t[k]: ``MEAN_OF_HOLDS`` averages the balance
        over u[k-1] and u[k], ``SAMPLE`` takes u[k]. By default the first for inputs held at zero
        order, the second otherwise.
    equation_std : mapping of str to float, optional
        σ_e by equation: ``"mass_flow_P"``, ``"mass_flow_N"`` [kg/s], ``"force"`` [N]; by default
        estimated from a first solution.
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
    ModelError
        If there is no record.

    Examples
    --------
    >>> import pneumo_casadi as pc
    >>> case = pc.example_case()
    >>> flow_map = pc.valve.read_flow_map(case.flow_map_path)
    >>> axis = pc.Servosystem(case.bench, pc.valve.fit_polynomials(flow_map, (7, 7, 4)))
    >>> fit = pc.fit_wls(axis, case.identify)
    >>> round(fit.parameters["M"].value, 1)
    16.9
    """
    recordings = (records,) if isinstance(records, Recording) else tuple(records)
    if not recordings:
        raise ModelError("no record to fit")
    chosen = tuple(names) if names is not None else tuple(model.regressor_names)
    plan = plan or plan_filters_for(recordings)
    observations = [
        observe(
            model,
            rec,
            chosen,
            plan,
            stick=stick,
            velocity_threshold=velocity_threshold,
            pairing=pairing,
        )
        for rec in recordings
    ]
    system = stack_systems([observation.system() for observation in observations])
    fit, removed = _fit_and_remove(system, equation_std, remove_above)
    fit = _with_scale_uncertainty(fit, model)
    parameters, outside = _at_estimates(model.parameters.select(fit.names), fit.estimate)
    total = sum(observation.t.size for observation in observations)
    return WLSResult(
        parameters=parameters,
        fit=fit,
        removed=removed,
        out_of_bounds=outside,
        plan=plan,
        stick=stick,
        velocity_threshold=_by_record(observations, [o.velocity_threshold for o in observations]),
        rows_dropped={name: total - used for name, used in fit.rows.items()},
        samples_dropped=_by_record(observations, [o.dropped for o in observations]),
        derived=_polytropic(fit),
        model=model,
        pairing=pairing,
    )


def _by_record(observations: Sequence[Observation], values: Sequence[_T]) -> dict[str, _T]:
    """Key values by the names of their records, numbered where a name comes twice."""
    names = [o.source for o in observations]
    keys = [name if names.count(name) == 1 else f"{name} ({i + 1})" for i, name in enumerate(names)]
    return dict(zip(keys, values, strict=True))


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
                total_error_percent(fit),
                total_error_percent(smaller),
            )
        )
        fit = smaller
    return fit, tuple(removed)


def _with_scale_uncertainty(fit: LinearFit, axis: Any) -> LinearFit:
    """Widen the covariances by the factors of the flows of chambers P and N."""
    added = flow_scale_covariance(fit.names, fit.estimate, axis)
    return replace(
        fit, covariance=fit.covariance + added, covariance_hac=fit.covariance_hac + added
    )


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


def _polytropic(fit: LinearFit) -> DerivedEstimates | None:
    known = {
        name: pair for name, pair in POLYTROPIC.items() if all(part in fit.names for part in pair)
    }
    return ratios(fit, known, covariance=fit.covariance_hac) if known else None
