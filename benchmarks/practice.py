"""Question: does a refit with the labelled effect close the gap to measurement, and find its size.

Data: the practice cases (``practice/`` of the data folder, 20 s to identify on, 20 s held out, one
hidden effect each, named in ``labels.json``), recorded from a bench program that shares no code
with this package. Nothing is random.

Each case: weighted least squares, then output error with the nominal axis over the whole record in
closed loop (see `gap`: the same set-up for every fit); then the same fit with the labelled effect,
begun at the nominal fit and the effect's starting values, or at WLS where that fails. Gaps on the
held-out record, in closed loop and in windows of 0.5 s, and the share that the refit closes are
defined in `gap`. A label is visible in a view where the nominal gap
exceeds twice that of the case without an effect.
"""

import argparse
import json
import logging
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import provenance
import tables
from gap import VIEWS, VISIBLE, Fitted, closed, fit_figures, held_out, nominal, refit

from pneumo_casadi.data import Case, read_case

#: Bars: share of a visible gap that a refit closes, and error of the labelled quantities [%].
CLOSED, WITHIN = 80.0, 30.0

Values = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Quantity:
    """A labelled quantity, and what the catalogue's parameters make of it.

    Parameters
    ----------
    label, unit : str
        Name and unit in the labels.
    of : callable
        The quantity from the effect's parameters, by their short names.
    differs : str
        Why the two need not agree; empty where the forms agree.
    """

    label: str
    unit: str
    of: Callable[[Values], float]
    differs: str = ""


QUANTITIES: Mapping[str, tuple[Quantity, ...]] = {
    "stribeck": (
        Quantity("str_dF", "N", lambda p: p["delta_F"]),
        Quantity("str_vs", "m/s", lambda p: p["v_stribeck"]),
    ),
    "pressure_friction": (Quantity("pfric", "N/Pa", lambda p: p["k_p"]),),
    "spring_load": (Quantity("spring", "N/m", lambda p: p["k"]),),
    "piston_seal_leakage": (Quantity("leakPN", "m3/(s Pa)", lambda p: p["C"]),),
    "leakage_P": (Quantity("leakPa", "m3/(s Pa)", lambda p: p["C"]),),
    "heat_transfer": (
        Quantity("energy", "1", lambda p: p["share"]),
        Quantity("hA", "W/(m2 K)", lambda p: p["h"]),
    ),
    "valve_dynamics": (
        Quantity("wn", "1/s", lambda p: 2 * p["zeta"] / p["tau"]),
        Quantity("zeta", "1", lambda p: p["zeta"]),
    ),
    "valve_dead_zone": (Quantity("dead", "V", lambda p: p["delta"]),),
    "supply_droop": (
        Quantity("supV", "m3", lambda p: 1 / p["per_volume"]),
        Quantity(
            "supC",
            "m3/(s Pa)",
            lambda p: p["C"],
            "a conductance of another regulator: its law is not stated with the label, the "
            "catalogue takes ISO 6358 with 0.3 and 0.5 at the undiminished supply pressure",
        ),
    ),
    "pressure_sensor_lag": (Quantity("p_lag", "s", lambda p: p["tau"]),),
    "backlash": (Quantity("backl", "m", lambda p: p["gap"]),),
}


def one_case(data: Path, labels: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return all figures of a practice case."""
    logging.disable(logging.WARNING)
    case, truth = read_case(data / "practice" / name), labels[name]["truth"]
    before, start, table = nominal(case)
    gap = held_out(before, case)
    results: dict[str, Any] = {
        "effects": labels[name]["effects"],
        "nominal": fit_figures(before) | {"errors_percent": errors(before, truth, case)},
        "nominal_gap": gap,
    }
    for effect in labels[name]["effects"]:
        after = refit(effect, before, start, case, table)
        results["refit"] = fit_figures(after) | {"errors_percent": errors(after, truth, case)}
        results["refit_gap"] = held_out(after, case)
        results["closed_percent"] = closed(gap, results["refit_gap"])
        results["quantities"] = quantities(effect, after, labels[name]["magnitudes"][effect])
    return results


def errors(fit: Fitted, truth: Values, case: Case) -> dict[str, float]:
    """Return the errors of the nominal axis' parameters [%], as far as the truth names them."""
    if fit.result is None:
        return {}
    p = fit.result.parameters.as_dict()
    rT = fit.result.axis.constants["r"] * fit.result.axis.constants["T"]
    results = {
        "M": p["M"],
        "fv": p["f_v"],
        "Fcp": p["F_c_plus"],
        "Fcm": p["F_c_minus"],
        "SP": p["X_s3"] * rT,
        "SN": p["X_s6"] * rT,
        "VP0": p["X_s1"] / p["X_s2"] * truth["SP"],
        "VN0": p["X_s4"] / p["X_s5"] * truth["SN"],
        "kP": p["X_s3"] / p["X_s2"],
        "kN": p["X_s6"] / p["X_s5"],
    }
    return {key: 100 * (results[key] / value - 1) for key, value in truth.items()}


def quantities(effect: str, fit: Fitted, magnitudes: Values) -> dict[str, Any]:
    """Return the labelled quantities beside what the refit makes of them."""
    if fit.result is None:
        return {}
    prefix = f"{effect}."
    own = {
        name.removeprefix(prefix): value
        for name, value in fit.result.parameters.as_dict().items()
        if name.startswith(prefix)
    }
    results = {}
    for quantity in QUANTITIES[effect]:
        value, label = quantity.of(own), magnitudes[quantity.label]
        results[quantity.label] = {
            "label": label,
            "fitted": value,
            "unit": quantity.unit,
            "error_percent": 100 * (value / label - 1),
            "forms_differ": quantity.differs or None,
        }
    return results


def judged(cases: dict[str, Any]) -> dict[str, Any]:
    """Return the cases with what is visible in them, and whether the bars are reached."""
    plain = [case["nominal_gap"] for case in cases.values() if not case["effects"]]
    if not plain or None in plain:
        raise RuntimeError("no case without an effect was fitted: nothing to compare gaps with")
    background = {view: max(gap[view]["gap_percent"] for gap in plain) for view in VIEWS}
    for case in cases.values():
        gap = case["nominal_gap"]
        case["visible"] = [
            view
            for view in VIEWS
            if case["effects"]
            and (gap is None or gap[view]["gap_percent"] > VISIBLE * background[view])
        ]
        if case["effects"]:
            shares = [case["closed_percent"].get(view, {}).get("all") for view in case["visible"]]
            case["closes"] = all(share is not None and share >= CLOSED for share in shares)
            agree = [q for q in case["quantities"].values() if q["forms_differ"] is None]
            case["within"] = bool(case["quantities"]) and all(
                abs(q["error_percent"]) <= WITHIN for q in agree
            )
    return {"background_gap_percent": background, "cases": cases}


def _kept_case(
    keep: Path | None, data: Path, labels: Mapping[str, Any], name: str
) -> tuple[str, dict[str, Any]]:
    return name, provenance.kept(keep, name, partial(one_case, data, labels, name))


def run(data: Path, names: Iterable[str], workers: int, keep: Path | None) -> dict[str, Any]:
    """Return the figures of the named cases; print each as it is done."""
    labels = json.loads((data / "practice" / "labels.json").read_text("utf-8"))
    cases = {}
    with ProcessPoolExecutor(workers) as executor:
        for name, item in executor.map(partial(_kept_case, keep, data, labels), list(names)):
            cases[name] = item
            shares = item.get("closed_percent", {})
            told = {view: shares[view]["all"] for view in shares}
            fitted = {k: q["fitted"] / q["label"] for k, q in item.get("quantities", {}).items()}
            print(f"{name}: closed {told} %, fitted / label {fitted}", flush=True)
    return judged(cases)


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="holds practice/")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument(
        "--keep", type=Path, help="keep finished cases here, and take them up again"
    )
    parser.add_argument("--workers", type=int, default=1, help="cases at a time")
    parser.add_argument("--quick", action="store_true", help="two cases only")
    arguments = parser.parse_args()
    folders = sorted(path.name for path in (arguments.data / "practice").glob("p*"))
    names = [name for name in folders if not name.endswith("60s")]
    if arguments.quick:
        names = [name for name in names if name.startswith(("p01", "p09"))]
    if arguments.keep is not None:
        arguments.keep.mkdir(parents=True, exist_ok=True)
    result = run(arguments.data, names, arguments.workers, arguments.keep)
    result |= provenance.made(None, arguments.quick)
    print(tables.practice(result))
    provenance.write(arguments.json, result)


if __name__ == "__main__":
    main()
