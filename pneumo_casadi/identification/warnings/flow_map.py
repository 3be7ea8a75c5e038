"""Warnings about the flow map: its range, its form, and what the trajectories make of it."""

from collections.abc import Iterator, Sequence

import numpy as np

from pneumo_casadi.data import Bench, FlowSource, Recording
from pneumo_casadi.estimation.flow_scale import flow_scale_std
from pneumo_casadi.estimation.output_error import OutputErrorResult
from pneumo_casadi.identification.warnings.grading import SIGMAS, ResultWarning, limited, met
from pneumo_casadi.valve import (
    AnyFlowMap,
    FormSelection,
    iso6358_from_data_sheet,
    sonic_conductances,
)
from pneumo_casadi.valve.flow_pair import FlowMapPair, FlowPair, valve_of


def flow_map_warnings(
    records: Sequence[Recording], flow_map: AnyFlowMap | None, result: OutputErrorResult
) -> Iterator[ResultWarning]:
    """Yield what records and fit say of the map, or of the data sheet in place of one."""
    if flow_map is None:
        yield from _data_sheet_warnings(result)
        return
    P, N = flow_map if isinstance(flow_map, FlowMapPair) else (flow_map, flow_map)
    ranges = (
        ("p_P", P.p_range, "Pa"),
        ("p_N", N.p_range, "Pa"),
        ("u_P", P.u_range, "V"),
        ("u_N", N.u_range, "V"),
    )
    for channel, (low, high), unit in ranges:
        values = np.concatenate([record[channel] for record in records])
        outside = float(np.mean((values < low) | (values > high)))
        yield from limited(
            "outside map",
            outside,
            "flow_map",
            f"{channel} runs from {values.min():.4g} to {values.max():.4g} {unit}, outside the "
            f"metered {low:.4g} to {high:.4g} {unit} in {100 * outside:.2g} % of the samples: "
            "there the flow is extrapolated.",
        )
    if not set(result.axis.flow_parameters) & set(result.parameters.free_names):
        yield met(
            "held map",
            "flow_map",
            "The flow map was held: the intervals of X_s1 ... X_s6 from output error leave out "
            "what is unknown of its coefficients; refine it (leave out --fixed-map), or take the "
            "intervals of WLS, which contain it.",
        )
    deviation = result.flow_map_deviation
    if deviation is None:
        return
    yield from limited(
        "map residuals",
        deviation.rms,
        "flow_map",
        "The trajectories have moved the flow map: it now misses the metered points by "
        f"{deviation.rms:.2f} times as much as when it is fitted to them alone. Check that it is "
        "the map of this valve, at this supply pressure.",
    )
    yield from limited(
        "map scale",
        abs(deviation.scale - 1) - SIGMAS * max(flow_scale_std(result.axis).values()),
        "flow_map",
        f"The trajectories have multiplied all flows of the map by {deviation.scale:.4f}, more "
        "than the accuracy of a flow meter.",
    )


def _data_sheet_warnings(result: OutputErrorResult) -> Iterator[ResultWarning]:
    """Yield where the records need another flow at full opening than the data sheet states."""
    axis, bench = result.axis, result.axis.bench
    if not isinstance(bench, Bench):
        return
    both = isinstance(axis.flow, FlowPair)
    for chamber, valve in zip("PN" if both else "P", bench.valves, strict=False):
        if valve.source is not FlowSource.DATA_SHEET:
            continue
        assert valve.u_full and valve.accuracy
        model, rows = valve_of(axis.flow, chamber)
        theta = axis.parameters.select(axis.flow_parameters[rows]).values
        at = (-valve.u_full, valve.u_full), (bench.p_ext, bench.p_supply), bench.T
        stated = sonic_conductances(iso6358_from_data_sheet(bench, valve), *at)
        fitted = sonic_conductances(model, *at, theta)
        for conductance, ratio in (
            ("C_fill", fitted.fill / stated.fill),
            ("C_exhaust", fitted.exhaust / stated.exhaust),
        ):
            yield from limited(
                "data sheet",
                abs(np.log(max(ratio, 1e-12))) / valve.accuracy,
                "flow_map",
                f"{f'Valve of chamber {chamber}: the' if both else 'The'} records need "
                f"{ratio:.2g} times the flow that "
                f"{conductance} = {getattr(valve, conductance):.3g} m³/(s Pa) of the data sheet "
                "gives. Correct it in bench.json (1 dm³/(s bar) is 1e-8 m³/(s Pa)), or state the "
                "source 'none': a wrong value pulls X_s1 to X_s6.",
            )


def flow_form_warnings(selection: FormSelection | None) -> Iterator[ResultWarning]:
    """Yield what the comparison of the forms says of the chosen one."""
    if selection is None:
        return
    compared = {e.form.value: e.percent for e in selection.candidates if e.percent is not None}
    error = compared.get(selection.chosen.value, 0.0)
    yield from limited(
        "map form",
        error,
        "flow_map",
        f"No form fits the flow map: the best, {selection.chosen.value}, has an error at "
        f"withheld points of {error:.2g} % of the largest flow. Meter the map more densely, "
        "or check it for scatter.",
    )
