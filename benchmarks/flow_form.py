"""Question: does the form of the flow map that fits the map best also identify the axis best.

Data: ``practice/`` (the cases of 20 s) and ``practice_more/`` of the data folder, recorded from a
bench program that shares no equation with this package; true parameters are known of all. Cases
with several weak effects are left out: the model has none of these effects, and what they do to the
parameters hides the form. Axes of the virtual bench are left out for time: output error with eq. 12
takes many damped steps there. Nothing is random.

Each case is identified with several forms of the flow map over windows of 0.5 s of the first
seconds of its record, anchored by the map: the polynomials of eq. 12 with the paper's degrees and
with cross-validated ones, and ISO 6358. The spline is fitted only where it is chosen, because its
output error takes ten times as long. Beside the held-out error on the map stand the error of
windows of 0.5 s of the held-out record, after weighted least squares (WLS) and after output error
(OE), and the errors of X_s1 ... X_s6 against the truth. The model is the nominal one; where the
effect of a case is so large that output error does not converge in 40 iterations, it counts as
failed.
"""

import argparse
import json
import logging
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import provenance

from pneumo_casadi.data import Bench, Case, Recording, read_case
from pneumo_casadi.errors import PneumoError
from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.estimation.wls import fit_wls
from pneumo_casadi.identification.flow_form import read_flow
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.starting_axis import make_axis
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.validation.errors import window_errors
from pneumo_casadi.valve import PAPER_DEGREES, FlowForm, choose_flow_form

WINDOW = 0.5
OUTPUT_ERROR = OutputErrorOptions(window=WINDOW, max_iterations=40, recover=False)
#: Length of record that is identified on, and that is held out [s].
SECONDS = 3.0
#: Ends of the names of cases that are left out: long ones, and those with several effects.
LEFT_OUT = ("60s", "_among_weak", "_weak_only")


def chamber_parameters(true: Mapping[str, float], rT: float) -> dict[str, float]:
    """Return X_s1 ... X_s6 of a labelled case (eq. 10 and 11).

    Where heat is exchanged there is no true polytropic exponent: X_s3 and X_s6 alone.
    """
    X_s = {}
    for chamber, first in (("P", 1), ("N", 4)):
        V, S, k = true[f"V{chamber}0"], true[f"S{chamber}"], true.get(f"k{chamber}")
        if k is not None:
            X_s |= {f"X_s{first}": V / (k * rT), f"X_s{first + 1}": S / (k * rT)}
        X_s |= {f"X_s{first + 2}": S / rT}
    return X_s


def names_of(data: Path) -> list[str]:
    """Return the names of all cases."""
    groups = [
        [
            folder.relative_to(data).as_posix()
            for folder in sorted((data / group).iterdir())
            if folder.is_dir() and not folder.name.endswith(LEFT_OUT)
        ]
        for group in ("practice", "practice_more")
    ]
    return [name for names in zip_longest(*groups) for name in names if name]


def load(data: Path, name: str) -> tuple[Case, dict[str, float]]:
    """Return a case and its true X_s1 ... X_s6."""
    group, label = name.split("/")
    case = read_case(data / name)
    truth = json.loads((data / group / "labels.json").read_text("utf-8"))[label]["truth"]
    assert isinstance(case.bench, Bench)
    return case, chamber_parameters(truth, case.bench.r * case.bench.T)


def cut(records: Sequence[Recording]) -> tuple[Recording, ...]:
    """Return the first seconds of the first record."""
    first = records[0]
    return (first.window(first.t[0], first.t[0] + min(SECONDS, first.duration)),)


def held_out(axis: Axis, records: Sequence[Recording]) -> float:
    """Return the error of windows, mean over position and pressures [% of signal]."""
    errors = window_errors(axis, records, WINDOW)
    return float(np.mean([error.percent for error in errors.values()]))


def identified(case: Case, options: IdentifyOptions, truth: Mapping[str, float]) -> dict[str, Any]:
    """Return what one form makes of a case."""
    train, test = cut(case.identify), cut(case.validate)
    table, flow = read_flow(case, options)
    axis = make_axis(case, flow)
    began = time.perf_counter()
    wls = axis.started_at(fit_wls(axis, train).parameters)
    figures: dict[str, Any] = {"wls": summary(wls, test, truth)}
    try:
        fit = fit_output_error(wls, train, table, OUTPUT_ERROR)
    except PneumoError as error:
        return figures | {"output_error": None, "failure": str(error)}
    return figures | {
        "output_error": summary(fit.axis, test, truth),
        "cost": fit.cost,
        "status": fit.status,
        "seconds": time.perf_counter() - began,
    }


def summary(axis: Axis, test: Sequence[Recording], truth: Mapping[str, float]) -> dict[str, Any]:
    """Return the held-out error of an axis and the errors of its parameters [%]."""
    errors = {name: 100 * (axis.parameters[name].value / truth[name] - 1) for name in truth}
    return {
        "held_out_percent": held_out(axis, test),
        "errors_percent": errors,
        "rms_error_percent": float(np.sqrt(np.mean(np.square(list(errors.values()))))),
    }


def one_case(data: Path, name: str) -> dict[str, Any]:
    """Return the selection by the map and what every form makes of the case."""
    logging.disable(logging.WARNING)
    return compared(*load(data, name))


def compared(case: Case, truth: Mapping[str, float]) -> dict[str, Any]:
    """Return the selection by the map and what every form makes of a case."""
    table, _ = read_flow(case, IdentifyOptions(FlowForm.POLYNOMIALS))
    assert table is not None and isinstance(case.bench, Bench)
    began = time.process_time()
    selection = choose_flow_form(table, T=case.bench.T)
    seconds = time.process_time() - began
    asked = {
        "polynomials_7_7_4": IdentifyOptions(FlowForm.POLYNOMIALS, PAPER_DEGREES),
        "polynomials": IdentifyOptions(
            FlowForm.POLYNOMIALS, selection.error_of(FlowForm.POLYNOMIALS).degrees
        ),
        "iso6358": IdentifyOptions(FlowForm.ISO6358),
    }
    asked.setdefault(selection.chosen.value, IdentifyOptions(selection.chosen))
    forms = {name: identified(case, options, truth) for name, options in asked.items()}
    return {"selection": selection.as_dict(), "selection_seconds": seconds, "forms": forms}


def summarised(cases: Mapping[str, Any]) -> dict[str, Any]:
    """Return medians over the cases, and how often each criterion picks the best form.

    Criteria are compared on the cases where output error converged with every form.
    """
    means: dict[str, Any] = {}
    for form in dict.fromkeys(form for case in cases.values() for form in case["forms"]):
        fitted = [case["forms"][form] for case in cases.values() if form in case["forms"]]
        wls = [fit["wls"] for fit in fitted]
        done = [fit["output_error"] for fit in fitted if fit["output_error"] is not None]
        means[form] = {
            "failed": len(fitted) - len(done),
            "median_rms_error_percent_wls": median(fit["rms_error_percent"] for fit in wls),
            "median_rms_error_percent": median(fit["rms_error_percent"] for fit in done),
            "median_held_out_percent_wls": median(fit["held_out_percent"] for fit in wls),
            "median_held_out_percent": median(fit["held_out_percent"] for fit in done),
        }
    converged = [
        case
        for case in cases.values()
        if all(fit["output_error"] is not None for fit in case["forms"].values())
    ]
    rules = {
        "map": lambda case: case["selection"]["chosen"],
        "held_out_after_wls": lambda case: least(case, "wls", "held_out_percent"),
        "held_out_after_output_error": lambda case: least(case, "output_error", "held_out_percent"),
    }
    picked = {
        rule: {
            "nearest_to_truth": sum(
                pick(case) == least(case, "output_error", "rms_error_percent") for case in converged
            ),
            "median_rms_error_percent": median(
                case["forms"][pick(case)]["output_error"]["rms_error_percent"] for case in converged
            ),
        }
        for rule, pick in rules.items()
    }
    chosen = [case["selection"]["chosen"] for case in cases.values()]
    return {
        "forms": means,
        "rules": picked,
        "converged_with_every_form": len(converged),
        "chosen": {form: chosen.count(form) for form in sorted(set(chosen))},
        "longest_selection_s": max(case["selection_seconds"] for case in cases.values()),
    }


def least(case: Mapping[str, Any], stage: str, figure: str) -> str:
    """Return the form with the least figure after a stage."""
    figures = {name: fit[stage][figure] for name, fit in case["forms"].items()}
    return min(figures, key=figures.__getitem__)


def median(values: Iterator[float]) -> float:
    """Return the median of some figures; NaN without any."""
    known = list(values)
    return float(np.median(known)) if known else float("nan")


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="practice/ and practice_more/")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--workers", type=int, default=1, help="cases at a time")
    parser.add_argument("--quick", action="store_true", help="two cases only")
    arguments = parser.parse_args()
    names = names_of(arguments.data)[: 2 if arguments.quick else None]
    cases: dict[str, Any] = {}
    with ProcessPoolExecutor(arguments.workers) as executor:
        made = executor.map(partial(one_case, arguments.data), names)
        for name, case in zip(names, made, strict=True):
            cases[name] = case
            fits = {form: fit["output_error"] for form, fit in case["forms"].items()}
            told = {form: fit and round(fit["rms_error_percent"], 2) for form, fit in fits.items()}
            print(f"{name}: {case['selection']['chosen']}, X_s off by [%] {told}", flush=True)
            result = {"seconds_of_record": SECONDS, "cases": cases, "summary": summarised(cases)}
            provenance.write(arguments.json, result | provenance.made(None, arguments.quick))
    print(json.dumps(result["summary"], indent=1))


if __name__ == "__main__":
    main()
