"""Warnings about a result of an identification: its known weaknesses, graded by `grading`."""

from collections.abc import Iterator, Sequence

import numpy as np

from pneumo_casadi.data import Case, Recording
from pneumo_casadi.estimation.output_error import OutputErrorResult, RecordEstimates
from pneumo_casadi.estimation.wls import WLSResult
from pneumo_casadi.identification.warnings.flow_map import flow_form_warnings, flow_map_warnings
from pneumo_casadi.identification.warnings.grading import (
    LIMITS,
    ResultWarning,
    in_order,
    limited,
    met,
)
from pneumo_casadi.identification.warnings.physics import physics_warnings
from pneumo_casadi.metrics import signal_std
from pneumo_casadi.validation import Validation
from pneumo_casadi.valve import AnyFlowMap, FormSelection


def result_warnings(
    case: Case,
    records: Sequence[Recording],
    flow_map: AnyFlowMap | None,
    wls: WLSResult,
    result: OutputErrorResult,
    validation: Validation | None,
    selection: FormSelection | None = None,
    each_record: RecordEstimates | None = None,
) -> tuple[ResultWarning, ...]:
    """Collect the warnings of an identification, the gravest first.

    Among those of one grade, what the data themselves show comes first: it is the cause.

    Parameters
    ----------
    case : Case
        With the findings of its checks.
    records : sequence of Recording
        Those fitted.
    flow_map : FlowMap or None
        Measured map.
    wls : WLSResult
        Weighted least squares.
    result : OutputErrorResult
        Output error.
    validation : Validation or None
        Simulations of held-out records; None where there are none.
    selection : FormSelection, optional
        How the form of the flow map was chosen.
    each_record : RecordEstimates, optional
        Estimates from each of several records.

    Returns
    -------
    tuple of ResultWarning
    """
    return in_order(
        (
            *_of_data(case),
            *_of_solution(result),
            *physics_warnings(case, result),
            *flow_map_warnings(records, flow_map, result),
            *flow_form_warnings(selection),
            *validation_warnings(validation),
            *_of_misfit(case, records, result),
            *_of_records(each_record),
            *_of_intervals(wls, result),
            *_of_wls(wls),
        )
    )


def inflation(result: OutputErrorResult) -> float:
    """Return by how much correlated residuals widen the worst output-error interval.

    Parameters
    ----------
    result : OutputErrorResult
        The fit.

    Returns
    -------
    float
        The largest ratio of a robust to an ideal standard deviation; 1 where residuals are white.
    """
    ideal, robust = result.uncertainty.std, result.uncertainty.std_robust
    known = np.isfinite(ideal) & (ideal > 0) & np.isfinite(robust)
    return float(np.max(robust[known] / ideal[known], initial=1.0))


def _of_data(case: Case) -> Iterator[ResultWarning]:
    for finding in case.findings:
        yield ResultWarning(finding.grade, "recording", finding.sentence)


def _of_solution(result: OutputErrorResult) -> Iterator[ResultWarning]:
    if result.status != "converged":
        yield met(
            "not converged",
            "output_error",
            f"The output-error fit has not converged: {result.status}.",
        )
    if any(stage.status != "converged" for stage in result.stages[:-1]):  # others were planned
        yield met(
            "stages",
            "output_error",
            f"The fit needed {len(result.stages)} stages (by way of short windows): the model may "
            "misfit the data, or the start was far off.",
        )
    if result.chosen_window is not None:
        yield met(
            "long records",
            "output_error",
            f"The records are long: output error is fitted over windows of "
            f"{result.chosen_window:g} s with own initial states, as an open-loop simulation of a "
            "whole record may drift away; --window sets another length.",
        )
    flow = set(result.axis.flow_parameters)
    for name in result.uncertainty.at_bound:
        if name not in flow:  # the map's residuals tell what its coefficients are worth
            item = result.parameters[name]
            yield met(
                "axis at bound" if name == "M" or name.startswith("X_s") else "at bound",
                "output_error",
                f"{name} lies at its bound {item.value:.4g} {item.unit}: the cost decreases beyond "
                "it; its interval is one-sided and not given.",
            )
    unknown = [name for name in result.uncertainty.uninformed if name not in flow]
    if unknown:
        yield met(
            "uninformed",
            "output_error",
            f"The data say nothing about {', '.join(unknown)} (direction "
            f"{'; '.join(result.uncertainty.combinations)}): their intervals are infinite.",
        )


def validation_warnings(validation: Validation | None) -> Iterator[ResultWarning]:
    """Yield the warnings about simulations of held-out records.

    Parameters
    ----------
    validation : Validation or None
        The simulations; None where no record is held out.
    """
    if validation is None:
        yield met(
            "not held out",
            "validation",
            "The case has no record held out: the accuracy of predictions is unknown.",
        )
        return
    name, gap, view = largest_gap(validation)
    yield from limited(
        "held out",
        gap,
        "validation",
        f"On held-out records the simulation of {name} ({view}) is off by {_percent(gap)} of the "
        "signal beyond the sensor noise: the model omits something. The intervals of its "
        "parameters are void, for they do not contain the bias that this makes; `diagnose` looks "
        "for the cause.",
    )


def _percent(value: float) -> str:
    return f"{value:.0f} %" if value >= 10 else f"{value:.2g} %"


def simulation_sentence(validation: Validation) -> str:
    """Return the size of the largest gap on the held-out records in one sentence.

    Parameters
    ----------
    validation : Validation
        The simulations.
    """
    name, gap, view = largest_gap(validation)
    return (
        f"on held-out records the simulation ({view}) is off by {_percent(gap)} of the signal "
        f"beyond the sensor noise in the worst output ({name})."
    )


def largest_gap(validation: Validation) -> tuple[str, float, str]:
    """Return the output with the largest gap, the gap [% of the signal] and the simulation.

    Over the longest windows: over a whole record in open loop a position drifts, and its error
    grows with the length of the record. Where there are no windows, over the whole record.

    Parameters
    ----------
    validation : Validation
        The simulations.
    """
    view, errors = "open loop", validation.open_loop
    if validation.windows:
        length = max(validation.windows)
        view, errors = f"windows of {length:g} s", validation.windows[length]
    name = max(errors, key=lambda channel: errors[channel].gap_percent)
    return name, errors[name].gap_percent, view


def _of_misfit(
    case: Case, records: Sequence[Recording], result: OutputErrorResult
) -> Iterator[ResultWarning]:
    noise = case.bench.noise
    for name, sigma in zip(result.axis.outputs, result.sigma, strict=True):
        stated = getattr(noise, name[0], 0.0) if noise is not None else 0.0
        signal = signal_std(records, name)
        if stated and sigma > stated and signal > 0:
            yield from limited(
                "misfit",
                100 * float(np.sqrt(sigma**2 - stated**2)) / signal,
                "intervals",
                f"The residual of {name} is equivalent to white noise of {sigma:.3g} "
                f"{result.axis.unit(name)} per sample, {sigma / stated:.1f} times the noise stated "
                "in the bench: misfit is counted as noise, and no interval contains its bias.",
            )


def _of_intervals(wls: WLSResult, result: OutputErrorResult) -> Iterator[ResultWarning]:
    factors = {
        "output error": (inflation(result), "std_robust"),
        "WLS": (float(np.max(wls.std_hac / wls.std)), "std_hac"),
    }
    limit = LIMITS["widening"]
    narrow = {fit: known for fit, known in factors.items() if limit.grade(known[0]) is not None}
    if narrow:
        named = ", ".join(
            f"up to {factor:.1f} times too small for {fit} (use `{better}`)"
            for fit, (factor, better) in narrow.items()
        )
        yield from limited(
            "widening",
            max(factor for factor, _ in narrow.values()),
            "intervals",
            "The residuals are correlated in time. The intervals of tables and figures allow for "
            f"it; `std` in result.json does not, and is {named}.",
        )


def _of_records(each: RecordEstimates | None) -> Iterator[ResultWarning]:
    if each is None:
        return
    limit = LIMITS["spread"]
    apart = {n: each.spread(n) for n in each.names if limit.grade(each.excess(n)) is not None}
    if apart:
        named = ", ".join(f"{name} ({spread:.1f})" for name, spread in apart.items())
        yield from limited(
            "spread",
            max(each.excess(name) for name in apart),
            "intervals",
            "The estimates from single records differ by more than their intervals, by the factor "
            f"in brackets: {named}. Something that the model omits differs between the records; "
            "widen the intervals by these factors.",
        )
    if each.failed:
        yield met(
            "not alone",
            "output_error",
            f"Alone, {', '.join(each.failed)} could not be fitted: its estimates are not compared.",
        )


def _of_wls(wls: WLSResult) -> Iterator[ResultWarning]:
    if wls.out_of_bounds:
        yield met(
            "wls impossible",
            "wls",
            f"The WLS estimate of {', '.join(wls.out_of_bounds)} is physically impossible.",
        )
    limit = LIMITS["weak"]
    weak = {
        name: percent
        for name, percent in zip(wls.names, wls.relative_std_percent, strict=True)
        if limit.grade(percent) is not None
    }
    if weak:
        named = ", ".join(f"{name} ({percent:.0f} %)" for name, percent in weak.items())
        yield from limited(
            "weak",
            max(weak.values()),
            "wls",
            f"WLS: relative standard deviation above {limit.note:g} % for {named}: by eq. 17 they "
            "may be removed.",
        )
    yield from limited(
        "sampling",
        100 / wls.plan.sampling_ratio,
        "wls",
        f"Sampled at {wls.plan.sampling_ratio:.0f} times the bandwidth of the motion; eq. 14 "
        "asks for 100 times.",
    )
