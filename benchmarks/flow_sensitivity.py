"""Question: how do X_s, k_P and k_N move with the approximation of the flow map.

Data: ``table1/`` and ``practice/p01_none/`` (20 s each), recorded from a bench program that shares
no equation with this package; true parameters are known. The map is written in several forms,
metered with errors in gain and pressure and with noise (drawn from given seeds), and held fixed,
anchored or left out in output error (OE). Windows of 0.5 s, in which a map held fixed leads no
trajectory astray, serve all fits; whole records are set beside them.

Figures: errors of X_s, k_P and k_N against the truth; shifts of the estimates by refitting and to
first order.
"""

import argparse
import json
import os
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import provenance
import tables

from pneumo_casadi.data import Bench, Case, read_case
from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.estimation.wls import fit_wls
from pneumo_casadi.model.servosystem import Servosystem
from pneumo_casadi.report.figures.studies.flow_sensitivity import flow_sensitivity_figure
from pneumo_casadi.report.tables import paper
from pneumo_casadi.sensitivity import (
    Estimate,
    FlowSensitivity,
    MapSensitivity,
    MeteringErrors,
    Row,
    Treatment,
    flow_sensitivity,
    map_sensitivity,
)
from pneumo_casadi.valve import (
    FlowMap,
    fit_iso6358,
    fit_polynomials,
    fit_spline,
    read_flow_map,
)

DEGREES = ((3, 3, 3), (5, 5, 4), (7, 7, 4), (7, 7, 7), (9, 9, 9), (12, 12, 12))
#: The form whose map is metered wrongly.
METERED = (9, 9, 9)
NOISES = (0.001, 0.003, 0.01)
ERRORS = (
    MeteringErrors(gain=0.01),
    MeteringErrors(gain_filling=0.01),
    MeteringErrors(gain_exhaust=0.01),
    MeteringErrors(pressure_offset=1000.0),
)
#: Forms that the second case is identified with.
FEW = ("7-7-4", "9-9-9", "ISO 6358")
WINDOW = 0.5
#: Length of record behind the shifts by metering errors, and of everything in a quick run [s].
METERED_S, QUICK = 6.0, 4.0
CHAMBERS = tuple(f"X_s{i}" for i in range(1, 7))
RATIOS = ("k_P", "k_N")


@dataclass(frozen=True)
class Known:
    """A case with its flow map and its true parameters."""

    case: Case
    bench: Bench
    table: FlowMap
    truth: Mapping[str, float]


def load(folder: Path, name: str) -> Known:
    """Load a case by its name below the data folder."""
    case = read_case(folder / name)
    bench = case.bench
    assert isinstance(bench, Bench) and case.flow_map_path is not None
    table = read_flow_map(case.flow_map_path, p_supply=bench.p_supply, p_ext=bench.p_ext)
    if name == "table1":
        truth = {n: value for n, (value, _) in paper.TABLE_1.items()}
    else:
        labels = json.loads((folder / "practice" / "labels.json").read_text("utf-8"))
        truth = chamber_parameters(labels[case.name]["truth"], bench.r * bench.T)
    truth |= {"k_P": truth["X_s3"] / truth["X_s2"], "k_N": truth["X_s6"] / truth["X_s5"]}
    return Known(case, bench, table, truth)


def chamber_parameters(true: Mapping[str, float], rT: float) -> dict[str, float]:
    """Return X_s1 ... X_s6 and the mechanical parameters of a labelled case (eq. 10 and 11)."""
    results = {}
    for chamber, first in (("P", 1), ("N", 4)):
        V, S, k = (true[f"{name}"] for name in (f"V{chamber}0", f"S{chamber}", f"k{chamber}"))
        results |= {f"X_s{first}": V / (k * rT), f"X_s{first + 1}": S / (k * rT)}
        results |= {f"X_s{first + 2}": S / rT}
    names = {"M": "M", "f_v": "fv", "F_c_plus": "Fcp", "F_c_minus": "Fcm"}
    return results | {name: true[label] for name, label in names.items()}


def label(degrees: Sequence[int]) -> str:
    """Return degrees as the README writes them."""
    return "-".join(map(str, degrees))


def study(
    known: Known,
    forms: Mapping[str, Any],
    executor: Executor,
    *,
    window: float | None = WINDOW,
    held_out: bool = False,
    seconds: float | None = None,
    **more: Any,
) -> FlowSensitivity:
    """Run a study on a case, on the first seconds of its records."""
    records = known.case.identify
    if seconds is not None:
        records = tuple(r.window(r.t[0], r.t[0] + min(seconds, r.duration)) for r in records)
    options = OutputErrorOptions(window=window)
    return flow_sensitivity(
        known.bench,
        records,
        known.table,
        forms,
        held_out=known.case.validate if held_out else (),
        options=options,
        executor=executor,
        progress=lambda text, share: print(f"  {share:4.0%} {text}", flush=True),
        **more,
    )


def errors(estimates: Mapping[str, Estimate], truth: Mapping[str, float]) -> dict[str, Any] | None:
    """Return errors and deviations in per cent of the truth; None where there is no estimate."""
    if not estimates:
        return None
    return {
        name: {
            "error_percent": 100 * (estimates[name].value / true - 1),
            "std_percent": finite(100 * estimates[name].std / abs(true)),
        }
        for name, true in truth.items()
        if name in estimates
    }


def finite(value: float) -> float | None:
    """Return a number that JSON can hold."""
    return value if np.isfinite(value) else None


def described(row: Row, truth: Mapping[str, float]) -> dict[str, Any]:
    """Return a row as plain values."""
    return {
        "form": row.variant.form,
        "treatment": row.variant.treatment.value,
        "status": row.status,
        "map_error_percent": None if row.map_error is None else 100 * row.map_error,
        "map_error_used_percent": (
            None if row.map_error_used is None else 100 * row.map_error_used
        ),
        "wls": errors(row.wls, truth),
        "output_error": errors(row.output_error, truth),
        "held_out_percent": row.held_out,
        "iterations": row.iterations,
        "seconds": row.seconds,
    }


def moved(
    result: Mapping[str, Estimate], reference: Mapping[str, Estimate]
) -> dict[str, float] | None:
    """Return the shift of each estimate in per cent."""
    if not result or not reference:
        return None
    return {n: 100 * (result[n].value / reference[n].value - 1) for n in (*CHAMBERS, *RATIOS)}


def linear(
    sensitivity: MapSensitivity,
    metering: MeteringErrors,
    known: Known,
    treatment: Treatment,
    reference: Mapping[str, Estimate],
) -> dict[str, float]:
    """Return the shift to first order, in per cent of the estimate."""
    shift = sensitivity.shift(flow_error(metering, known), treatment)
    return {n: 100 * shift[n] / reference[n].value for n in (*CHAMBERS, *RATIOS)}


def flow_error(metering: MeteringErrors, known: Known) -> Any:
    """Return errors of the metered flows; a wrong pressure is a wrong flow at the right one."""
    error = metering.flow_error(known.table)
    if metering.pressure_offset:
        flow = fit_polynomials(known.table, METERED)
        u, p = known.table.u, known.table.p
        error = error + flow(u, p - metering.pressure_offset) - flow(u, p)
    return error


def metering_errors(
    known: Known, executor: Executor, seeds: int, seconds: float | None
) -> dict[str, Any]:
    """Return shifts of the estimates by errors of the map, by refitting and to first order."""
    form = {label(METERED): partial(fit_polynomials, degrees=METERED)}
    noises = [MeteringErrors(noise=noise, seed=seed) for noise in NOISES for seed in range(seeds)]
    treatments = (Treatment.ANCHORED, Treatment.FIXED)
    result = study(
        known,
        form,
        executor,
        seconds=seconds,
        meterings=(MeteringErrors(), *ERRORS, *noises),
        treatments=treatments,
    )
    sensitivity = first_order(known, seconds)
    name = label(METERED)
    shifts = []
    for metering in ERRORS:
        results: dict[str, Any] = {"metering": str(metering)}
        for treatment in treatments:
            row, plain = result.row(name, treatment, metering), result.row(name, treatment)
            results["wls"] = moved(row.wls, plain.wls)
            key = treatment.value
            results[key] = moved(row.output_error, plain.output_error)
            results[f"{key}_first_order"] = linear(
                sensitivity, metering, known, treatment, plain.output_error
            )
        shifts.append(results)
    spreads = [spread(known, result, sensitivity, noise, seeds) for noise in NOISES]
    return {"form": name, "seconds": seconds, "shifts": shifts, "noise": spreads}


def first_order(known: Known, seconds: float | None) -> MapSensitivity:
    """Return the sensitivities of an anchored fit of the map as metered."""
    records = known.case.identify
    if seconds is not None:
        records = tuple(r.window(r.t[0], r.t[0] + min(seconds, r.duration)) for r in records)
    axis = Servosystem(known.bench, fit_polynomials(known.table, METERED))
    start = axis.started_at(fit_wls(axis, records).parameters)
    result = fit_output_error(start, records, known.table, OutputErrorOptions(window=WINDOW))
    return map_sensitivity(result, known.table)


def spread(
    known: Known, result: FlowSensitivity, sensitivity: MapSensitivity, noise: float, seeds: int
) -> dict[str, Any]:
    """Return spreads of the estimates over seeds of the map's noise, and those to first order."""
    names, form = (*CHAMBERS, *RATIOS), label(METERED)
    drawn = [MeteringErrors(noise=noise, seed=seed) for seed in range(seeds)]
    results: dict[str, Any] = {"noise_percent": 100 * noise, "seeds": seeds}
    for treatment in (Treatment.ANCHORED, Treatment.FIXED):
        plain = result.row(form, treatment).output_error
        rows = [result.row(form, treatment, metering) for metering in drawn]
        converged = [row.output_error for row in rows if row.converged]
        results["wls"] = spread_percent([row.wls for row in rows], names)
        results[treatment.value] = spread_percent(converged, names)
        results[f"{treatment.value}_failed"] = seeds - len(converged)
        std = sensitivity.std(noise * known.table.q_max, treatment)
        results[f"{treatment.value}_first_order"] = {
            n: 100 * std[n] / plain[n].value for n in names
        }
    return results


def spread_percent(
    result: Sequence[Mapping[str, Estimate]], names: Sequence[str]
) -> dict[str, float] | None:
    """Return the standard deviation of each estimate over replicates, in per cent."""
    if len(result) < 2:
        return None
    values = {n: np.array([item[n].value for item in result]) for n in names}
    return {n: float(100 * v.std(ddof=1) / abs(v.mean())) for n, v in values.items()}


def forms_of(bench: Bench, names: Sequence[str] | None = None) -> dict[str, Any]:
    """Return the forms that are compared, all or those named."""
    result: dict[str, Any] = {label(d): partial(fit_polynomials, degrees=d) for d in DEGREES}
    result |= {"ISO 6358": partial(fit_iso6358, T=bench.T)}
    return result if names is None else {name: result[name] for name in names}


def run(data: Path, executor: Executor, seeds: int, quick: bool) -> dict[str, Any]:
    """Return the figures of the benchmark."""
    began = time.perf_counter()
    seconds = QUICK if quick else None
    table1 = load(data, "table1")
    commands = np.abs(np.concatenate([r["u_P"] for r in table1.case.identify]))
    result: dict[str, Any] = {
        "largest_command_V": float(commands.max()),
        "metered_command_V": float(table1.table.u.max()),
        "forms": {},
    }
    for name in ("table1",) if quick else ("table1", "p01_none"):
        print(f"{name}: forms over windows of {WINDOW:g} s")
        known = table1 if name == "table1" else load(data, f"practice/{name}")
        chosen = ("7-7-4", "7-7-7") if quick else None if name == "table1" else FEW
        forms = forms_of(known.bench, chosen)
        rows = study(known, forms, executor, held_out=not quick, seconds=seconds).rows
        if name == "table1" and not quick:
            # A gain is all that output error may refine of a spline: held fixed, it is the same.
            spline = {"spline": fit_spline}
            rows += study(known, spline, executor, treatments=(Treatment.FIXED,)).rows
        result["forms"][name] = [described(row, known.truth) for row in rows]
    print("table1: errors of the metered map")
    result["metering"] = metering_errors(table1, executor, seeds, QUICK if quick else METERED_S)
    print("table1: forms over the whole record")
    forms = forms_of(table1.bench, ("7-7-4", "ISO 6358"))
    both = (Treatment.FIXED, Treatment.ANCHORED)
    rows = study(table1, forms, executor, window=None, seconds=seconds, treatments=both).rows
    result["whole_record"] = [described(row, table1.truth) for row in rows]
    return result | {"seconds": time.perf_counter() - began}


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="holds table1/ and practice/")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--figure", type=Path, help="write the figure to this PNG file")
    parser.add_argument("--seeds", type=int, default=8, help="replicates of the map's noise")
    parser.add_argument("--quick", action="store_true", help="few forms, four seconds, two seeds")
    arguments = parser.parse_args()
    with ProcessPoolExecutor(max_workers=os.cpu_count()) as executor:
        seeds = 2 if arguments.quick else arguments.seeds
        result = run(arguments.data, executor, seeds, arguments.quick)
    result |= provenance.made(0, arguments.quick)  # seeds of the map's noise count from 0
    provenance.write(arguments.json, result)
    print(tables.flow_forms(result))
    print(tables.flow_metering(result))
    if arguments.figure is not None:
        flow_sensitivity_figure(result).savefig(arguments.figure)


if __name__ == "__main__":
    main()
