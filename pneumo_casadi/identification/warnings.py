"""Warnings about a result of an identification: its known weaknesses."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.data import Case, Recording
from pneumo_casadi.estimation.output_error import OutputErrorResult
from pneumo_casadi.estimation.wls import WLSResult
from pneumo_casadi.validation import Validation
from pneumo_casadi.valve import FlowMap, FormSelection

#: Factor by which intervals are too narrow from which a warning is given.
INFLATION = 1.5
#: Estimated over stated noise of one sample from which a misfit is reported.
EXCESS_NOISE = 1.2
#: Relative standard deviation from which eq. 17 calls a parameter removable [%].
REMOVABLE_PERCENT = 10.0
#: Ratio of the residuals of the flow map to those of its own fit above which a warning is given.
MAP_PULL = 1.3
#: Held-out error of the chosen form of the flow map from which it is reported [% of the largest
#: flow]: the usual accuracy of a flow meter.
MAP_MISFIT = 1.0
#: Ratio of the held-out error of another form to that of the chosen one that is reported.
FORMS_DIFFER = 2.0
#: Deviation of the common factor of all flows from 1 that exceeds the accuracy of a flow meter.
MAP_SCALE = 0.02
#: Relative deviation of a parameter from its data sheet value that is reported.
DATASHEET = 0.1
#: Polytropic coefficients: isothermal to adiabatic.
K_RANGE = (1.0, 1.4)
#: Share of samples outside the metered range from which it is reported.
OUTSIDE = 1e-3
#: Held-out error over sensor noise from which the gap is reported.
GAP = 3.0


@dataclass(frozen=True, slots=True)
class ResultWarning:
    """One reason for caution.

    Parameters
    ----------
    topic : str
        What it concerns: ``"recording"``, ``"flow_map"``, ``"wls"``, ``"output_error"``,
        ``"intervals"``, ``"physics"`` or ``"validation"``.
    text : str
        One sentence for the reader.
    """

    topic: str
    text: str


def result_warnings(
    case: Case,
    records: Sequence[Recording],
    flow_map: FlowMap | None,
    wls: WLSResult,
    result: OutputErrorResult,
    validation: Validation | None,
    selection: FormSelection | None = None,
) -> tuple[ResultWarning, ...]:
    """Collect the warnings of an identification, those that weigh most first."""
    return (
        *_of_solution(result),
        *_of_intervals(case, result),
        *_of_flow_map(records, flow_map, result),
        *_of_flow_form(selection),
        *_of_physics(case, result),
        *_of_wls(wls),
        *_of_validation(validation),
        *(ResultWarning("recording", note) for note in case.notes),
    )


def inflation(result: OutputErrorResult) -> float:
    """Return by how much correlated residuals widen the worst output-error interval.

    The largest ratio of a robust to an ideal standard deviation; 1 where residuals are white.
    """
    ideal, robust = result.uncertainty.std, result.uncertainty.std_robust
    known = np.isfinite(ideal) & (ideal > 0) & np.isfinite(robust)
    return float(np.max(robust[known] / ideal[known], initial=1.0))


def _of_solution(result: OutputErrorResult) -> Iterator[ResultWarning]:
    if result.status != "converged":
        yield ResultWarning(
            "output_error", f"The output-error fit has not converged: {result.status}."
        )
    if len(result.stages) > 1:
        yield ResultWarning(
            "output_error",
            f"The fit needed {len(result.stages)} stages (by way of short windows): the model may "
            "misfit the data, or the start was far off.",
        )
    for name in result.uncertainty.at_bound:
        value = result.parameters[name]
        yield ResultWarning(
            "output_error",
            f"{name} lies at its bound {value.value:.4g} {value.unit}: the cost decreases beyond "
            "it; its interval is one-sided and not given.",
        )
    if result.uncertainty.uninformed:
        yield ResultWarning(
            "output_error",
            f"The data say nothing about {', '.join(result.uncertainty.uninformed)} (direction "
            f"{'; '.join(result.uncertainty.combinations)}): their intervals are infinite.",
        )


def _of_intervals(case: Case, result: OutputErrorResult) -> Iterator[ResultWarning]:
    factor = inflation(result)
    if factor > INFLATION:
        yield ResultWarning(
            "intervals",
            "The output-error residuals are correlated in time: they contain effects that "
            "the model omits. Intervals from `std`, which assumes white residuals, are up to "
            f"{factor:.1f} times too narrow; `std_robust` allows for the correlation. Neither "
            "contains the bias of a wrong model.",
        )
    noise = case.bench.noise
    for name, sigma in zip(result.axis.outputs, result.sigma, strict=True):
        stated = getattr(noise, name[0], 0.0) if noise is not None else 0.0
        if stated and sigma > EXCESS_NOISE * stated:
            unit = result.axis.unit(name)
            yield ResultWarning(
                "intervals",
                f"The residual of {name} is equivalent to white noise of {sigma:.3g} {unit} per "
                f"sample, {sigma / stated:.1f} times the noise stated in the bench ({stated:.3g} "
                f"{unit}): misfit is counted as noise.",
            )


def _of_flow_map(
    records: Sequence[Recording], flow_map: FlowMap | None, result: OutputErrorResult
) -> Iterator[ResultWarning]:
    if flow_map is None:
        return
    ranges = (
        ("p_P", flow_map.p_range, "Pa"),
        ("p_N", flow_map.p_range, "Pa"),
        ("u_P", flow_map.u_range, "V"),
        ("u_N", flow_map.u_range, "V"),
    )
    for channel, (low, high), unit in ranges:
        values = np.concatenate([record[channel] for record in records])
        outside = float(np.mean((values < low) | (values > high)))
        if outside > OUTSIDE:
            yield ResultWarning(
                "flow_map",
                f"{channel} runs from {values.min():.4g} to {values.max():.4g} {unit}, outside the "
                f"metered {low:.4g} to {high:.4g} {unit} in {100 * outside:.2g} % of the samples: "
                "there the flow is extrapolated.",
            )
    yield ResultWarning(
        "flow_map",
        "No interval contains the accuracy of the flow meter: a map metered 1 % too high makes "
        "X_s1 ... X_s6 1 % too large, and changes no trajectory. Errors of the form of the map "
        "shift k_P, k_N, X_s2 and X_s5 most.",
    )
    deviation = result.flow_map_deviation
    if deviation is not None and (deviation.rms > MAP_PULL or abs(deviation.scale - 1) > MAP_SCALE):
        yield ResultWarning(
            "flow_map",
            "The trajectories have moved the flow map: its residuals are "
            f"{deviation.rms:.2f} times those of its own fit, and its overall scale is "
            f"{deviation.scale:.4f}. Map and trajectories disagree beyond the map's own misfit.",
        )


def _of_flow_form(selection: FormSelection | None) -> Iterator[ResultWarning]:
    if selection is None:
        return
    compared = {e.form.value: e.percent for e in selection.candidates if e.percent is not None}
    if selection.chosen.value not in compared:
        return
    error = compared[selection.chosen.value]
    if error > MAP_MISFIT:
        yield ResultWarning(
            "flow_map",
            f"No form fits the flow map: the best, {selection.chosen.value}, has an error at "
            f"withheld points of {error:.2g} % of the largest flow. Meter the map more densely, "
            "or check it for scatter.",
        )
    worse = [f"{name} {e:.2g} %" for name, e in compared.items() if e > FORMS_DIFFER * error]
    if worse:
        yield ResultWarning(
            "flow_map",
            f"The forms of the flow map differ in their error at withheld points: "
            f"{selection.chosen.value} {error:.2g} % of the largest flow, {', '.join(worse)}. "
            "X_s2, X_s5, k_P and k_N depend most on the form.",
        )


def _of_physics(case: Case, result: OutputErrorResult) -> Iterator[ResultWarning]:
    low, high = K_RANGE
    for name in ("k_P", "k_N"):
        if name in result.derived and not low <= result.derived[name].value <= high:
            yield ResultWarning(
                "physics",
                f"{name} = {result.derived[name].value:.3f} is not between {low:g} (isothermal) "
                f"and {high:g} (adiabatic): the parameters may have absorbed an unmodelled effect.",
            )
    sheet = case.bench.datasheet.get("M_kg")
    M = result.parameters["M"].value
    if sheet and abs(M / sheet - 1) > DATASHEET:
        yield ResultWarning(
            "physics", f"M = {M:.4g} kg is {100 * (M / sheet - 1):+.0f} % off the data sheet."
        )
    for chamber in case.bench.kind.gas_chambers:
        geometric = getattr(case.bench, f"S_{chamber}")
        share = result.derived[f"S_{chamber}"].value / geometric - 1
        if abs(share) > DATASHEET:
            yield ResultWarning(
                "physics",
                f"The area S_{chamber} computed from the fit is {100 * share:+.0f} % off that of "
                "the bench: look for a wrong temperature, flow scale or leak.",
            )
    for name in ("F_c_plus", "F_c_minus"):
        if result.parameters[name].value < 0:
            yield ResultWarning(
                "physics",
                f"{name} = {result.parameters[name].value:.3g} N is negative: the friction "
                "parameters contain a constant force.",
            )


def _of_wls(wls: WLSResult) -> Iterator[ResultWarning]:
    for name in wls.out_of_bounds:
        yield ResultWarning("wls", f"The WLS estimate of {name} is physically impossible.")
    weak = [
        f"{name} ({percent:.0f} %)"
        for name, percent in zip(wls.names, wls.relative_std_percent, strict=True)
        if percent >= REMOVABLE_PERCENT
    ]
    if weak:
        yield ResultWarning(
            "wls",
            f"WLS: relative standard deviation above {REMOVABLE_PERCENT:g} % for "
            f"{', '.join(weak)}: by eq. 17 they may be removed.",
        )
    ratio = float(np.max(wls.std_hac / wls.std))
    if ratio > INFLATION:
        yield ResultWarning(
            "wls",
            "The WLS residuals are correlated: the standard deviations of eq. 16 are too small, by "
            f"a factor of up to {ratio:.1f}; `std_hac` allows for it, not for bias.",
        )
    if wls.plan.sampling_ratio < 100:
        yield ResultWarning(
            "wls",
            f"Sampled at {wls.plan.sampling_ratio:.0f} times the bandwidth of the motion; eq. 14 "
            "asks for 100 times.",
        )


def _of_validation(validation: Validation | None) -> Iterator[ResultWarning]:
    if validation is None:
        yield ResultWarning(
            "validation", "The case has no record held out: the accuracy of predictions is unknown."
        )
        return
    gaps = [
        f"{name} {error.rms / error.percent * error.noise_percent:.2g} → {error.rms:.2g} "
        f"{error.unit}"
        for name, error in validation.open_loop.items()
        if error.noise_percent and error.percent > GAP * error.noise_percent
    ]
    if gaps:
        yield ResultWarning(
            "validation",
            "On held-out records the error of the open-loop simulation is clearly above the sensor "
            f"noise (noise → error: {', '.join(gaps)}).",
        )
