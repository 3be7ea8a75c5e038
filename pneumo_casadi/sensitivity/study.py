"""Identify an axis again and again, with other forms, errors and uses of the flow map."""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pneumo_casadi.data import Bench, Recording
from pneumo_casadi.errors import ModelError, PneumoError
from pneumo_casadi.estimation.output_error import (
    OutputErrorOptions,
    OutputErrorResult,
    fit_output_error,
)
from pneumo_casadi.estimation.wls import WLSResult, fit_wls, ratios
from pneumo_casadi.estimation.wls.fit import POLYTROPIC
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.servosystem import Servosystem
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.progress import Progress, no_progress
from pneumo_casadi.sensitivity.metering import MeteringErrors
from pneumo_casadi.sensitivity.variants import Estimate, Row, Treatment, Variant
from pneumo_casadi.validation import validate
from pneumo_casadi.valve import FlowMap, FlowModel

#: Fits a form to a measured map; `functools.partial` of a library function can be sent to
#: another process.
FitFlow = Callable[[FlowMap], FlowModel]

CHAMBERS = tuple(f"X_s{i}" for i in range(1, 7))


@dataclass(frozen=True, slots=True)
class FlowSensitivity:
    """All variants of a study.

    Parameters
    ----------
    rows : tuple of Row
        Forms outermost, then meterings, then treatments; failures keep their place.
    """

    rows: tuple[Row, ...]

    def row(self, form: str, treatment: Treatment, metering: MeteringErrors | None = None) -> Row:
        """Return the row of one variant; without `metering` that of the map as metered."""
        wanted = Variant(form, metering or MeteringErrors(), treatment)
        for row in self.rows:
            if row.variant == wanted:
                return row
        raise ModelError(f"no variant {form}, {wanted.metering}, {treatment.value} in the study")

    def frame(self) -> pd.DataFrame:
        """Return one line a variant: what was varied, status, estimates ``wls.X_s1`` and so on."""
        lines = []
        for row in self.rows:
            line: dict[str, object] = {
                "form": row.variant.form,
                "metering": str(row.variant.metering),
                "treatment": row.variant.treatment.value,
                "status": row.status,
                "map_error": row.map_error,
                "map_error_used": row.map_error_used,
            }
            for key, estimates in (("wls", row.wls), ("output_error", row.output_error)):
                for name, estimate in estimates.items():
                    line[f"{key}.{name}"] = estimate.value
                    line[f"{key}.{name}.std"] = estimate.std
            lines.append(line)
        return pd.DataFrame(lines)


@dataclass(frozen=True, slots=True)
class _Job:
    """All treatments of one map: weighted least squares is done once for them."""

    bench: Bench
    records: tuple[Recording, ...]
    held_out: tuple[Recording, ...]
    table: FlowMap
    form: str
    fit: FitFlow
    metering: MeteringErrors
    treatments: tuple[Treatment, ...]
    options: OutputErrorOptions


def flow_sensitivity(
    bench: Bench,
    records: Sequence[Recording],
    flow_map: FlowMap,
    forms: Mapping[str, FitFlow],
    meterings: Sequence[MeteringErrors] = (MeteringErrors(),),
    treatments: Sequence[Treatment] = tuple(Treatment),
    *,
    held_out: Sequence[Recording] = (),
    options: OutputErrorOptions | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> FlowSensitivity:
    """Identify an axis with each form, error and treatment of its flow map.

    Parameters
    ----------
    bench : Bench
        The axis.
    records : sequence of Recording
        Fitted together.
    flow_map : FlowMap
        Measured map, taken for true where a metering puts errors on it.
    forms : mapping of str to callable
        Each takes a map and returns a fitted flow model, for example
        ``{"7-7-4": functools.partial(fit_polynomials, degrees=(7, 7, 4))}``.
    meterings : sequence of Metering
        Errors to put on the map before it is fitted.
    treatments : sequence of Treatment
        How output error treats the coefficients of the map.
    held_out : sequence of Recording, optional
        Records for the open-loop error.
    options : OutputErrorOptions, optional
        Set-up of all output-error fits.
    executor : concurrent.futures.Executor, optional
        Where forms and meterings are worked off side by side; by default here, one by one.
    progress : callable, optional
        Called as ``progress(text, share)``.

    Returns
    -------
    FlowSensitivity
        A fit that fails is a row with its reason.

    Raises
    ------
    ModelError
        If there is nothing to do.

    Notes
    -----
    *Gauge.* Multiplying all flows and X_s1 ... X_s6 by one constant changes no trajectory. With
    the map left out, one metered point sets the scale while the fit runs; then X_s1 ... X_s6
    are divided by the common factor that puts X_s3 at S_P/(r T) of the bench. Ratios such as
    k_P, and all that is mechanical, do not depend on it. A form whose only coefficient is a gain
    (the spline) has nothing left to free: it is fixed.
    """
    if not (records and forms and meterings and treatments):
        raise ModelError("no record, form, metering or treatment: there is nothing to compare")
    report = progress or no_progress
    jobs = [
        _Job(
            bench, tuple(records), tuple(held_out), flow_map, name, fit, metering,
            tuple(treatments), options or OutputErrorOptions(),
        )
        for name, fit in forms.items()
        for metering in meterings
    ]  # fmt: skip
    rows: list[Row] = []
    results = map(_work, jobs) if executor is None else executor.map(_work, jobs)
    for i, (job, variants) in enumerate(zip(jobs, results, strict=True)):
        rows += variants
        report(f"{job.form}, {job.metering}", (i + 1) / len(jobs))
    return FlowSensitivity(tuple(rows))


def _work(job: _Job) -> tuple[Row, ...]:
    variants = [Variant(job.form, job.metering, treatment) for treatment in job.treatments]
    table = job.metering.of(job.table)
    try:
        flow = job.fit(table)
        axis = Servosystem(job.bench, flow)
        wls = fit_wls(axis, job.records)
    except PneumoError as error:
        return tuple(Row(variant, str(error), {}, {}) for variant in variants)
    return tuple(_row(job, variant, table, axis, wls) for variant in variants)


def _row(job: _Job, variant: Variant, table: FlowMap, axis: Axis, wls: WLSResult) -> Row:
    flow: FlowModel = axis.flow
    began = time.perf_counter()
    e = flow.residuals(table) / table.q_max
    used = metered_in_range(table, job.records)
    errors = _root_mean_square(e), _root_mean_square(e[used]) if used.any() else None
    from_wls = dict(_wls_estimates(wls))
    try:
        result = _fit(job, variant.treatment, table, axis.started_at(wls.parameters))
        held_out = (
            {n: e.percent for n, e in validate(result.axis, job.held_out, ()).open_loop.items()}
            if job.held_out
            else None
        )
    except PneumoError as error:
        seconds = time.perf_counter() - began
        return Row(variant, str(error), from_wls, {}, *errors, seconds=seconds)
    estimates = dict(_estimates(result))
    if variant.treatment is Treatment.LEFT_OUT:
        estimates |= _in_gauge(result, job.bench.S_P / (job.bench.r * job.bench.T))
    return Row(
        variant,
        result.status,
        from_wls,
        estimates,
        *errors,
        dict(zip(axis.outputs, result.rms.tolist(), strict=True)),
        held_out,
        result.iterations,
        time.perf_counter() - began,
    )


def _fit(job: _Job, treatment: Treatment, table: FlowMap, axis: Axis) -> OutputErrorResult:
    names = axis.flow.parameters.names
    if treatment is Treatment.FIXED or (treatment is Treatment.LEFT_OUT and len(names) == 1):
        fixed = axis.with_parameters(axis.parameters.fix(*names))
        return fit_output_error(fixed, job.records, None, job.options)
    if treatment is Treatment.LEFT_OUT:
        # A single residual fixes the free scale: it is zero at the optimum and adds no information.
        inside = metered_in_range(table, job.records)
        flows = np.where(inside if inside.any() else True, np.abs(table.q_m), 0.0)
        table = table.select([int(np.argmax(flows))])
    return fit_output_error(axis, job.records, table, job.options)


def metered_in_range(table: FlowMap, records: Sequence[Recording]) -> NDArray[np.bool_]:
    """Tell which metered points lie within the commands and pressures of records, shape (n,)."""

    def range_of(*channels: str) -> tuple[float, float]:
        values = [record[channel] for record in records for channel in channels]
        return min(float(v.min()) for v in values), max(float(v.max()) for v in values)

    (u_low, u_high), (p_low, p_high) = range_of("u_P", "u_N"), range_of("p_P", "p_N")
    in_u = (table.u >= u_low) & (table.u <= u_high)
    return in_u & (table.p >= p_low) & (table.p <= p_high)


def _wls_estimates(wls: WLSResult) -> Iterator[tuple[str, Estimate]]:
    for name, value, std in zip(wls.names, wls.estimate, wls.std_hac, strict=True):
        yield name, Estimate(float(value), float(std))
    derived = ratios(wls.fit, POLYTROPIC, covariance=wls.covariance_hac)
    for name, value, std in zip(derived.names, derived.values, derived.std, strict=True):
        yield name, Estimate(float(value), float(std))


def _estimates(result: OutputErrorResult) -> Iterator[tuple[str, Estimate]]:
    coefficients = set(result.axis.flow.parameters.names)
    for name in result.uncertainty.names:
        if name not in coefficients:
            yield name, Estimate(result.parameters[name].value, result.std(name, robust=True))
    for name in POLYTROPIC:
        yield name, Estimate(result.derived[name].value, result.derived[name].std_robust)


def _in_gauge(result: OutputErrorResult, X_s3: float) -> dict[str, Estimate]:
    """Return X_s1 ... X_s6 times the common factor that gives X_s3 this value, by delta method."""
    at = [result.uncertainty.names.index(name) for name in CHAMBERS]
    robust = result.uncertainty.covariance_robust
    C = (result.uncertainty.covariance if robust is None else robust)[np.ix_(at, at)]
    X = np.array([result.parameters[name].value for name in CHAMBERS])
    scale = X_s3 / X[2]
    estimates = {}
    for i, name in enumerate(CHAMBERS):
        ratio = X[i] / X[2]
        variance = C[i, i] - 2 * ratio * C[i, 2] + ratio**2 * C[2, 2] if i != 2 else 0.0
        std = scale * math.sqrt(max(0.0, variance)) if np.isfinite(variance) else math.inf
        estimates[name] = Estimate(float(scale * X[i]), std)
    return estimates


def _root_mean_square(e: FloatArray) -> float:
    return float(np.sqrt(np.mean(e**2)))
