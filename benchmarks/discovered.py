"""Question: is a cause outside every catalogue described by the right term.

Data: cases of the virtual bench, which shares no equation with the model: random axes, each with
one cause that the diagnosis is not given; 20 s at 1 kHz of chirp and squares to identify on, 20 s
of multisine and steps held out. Causes: those of the bench that no catalogue lists, and listed ones
that are withheld. Sizes are large, scattered by the seed.

Each case: the nominal axis fitted to the balances along the smoothed motion, then `discovered`,
which knows no cause by name. Told: whether balance and driver are right, the share of the held-out
gap that closes, and by how much period, amplitude or slope differ from the truth where the formula
is that of the bench. Axes without a cause, and axes with a cause of the catalogue, go through the
whole diagnosis: a discovered term there is a false one.
"""

import argparse
import logging
import tempfile
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import provenance
from term_coverage import discovered

from pneumo_casadi.diagnosis import diagnose, prepare_study
from pneumo_casadi.diagnosis.discover.discovered import DiscoveredTerm
from pneumo_casadi.diagnosis.metrics.residual_size import balance_levels, residual_rms
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.identification.flow_form import resolve_flow_form
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.virtual_bench import make_case

SEED = 20260
DURATION, QUICK_DURATION = 20.0, 6.0
SEVERITY = "large"
#: A gap shows where a held-out residual exceeds the noise floor so many times, as for verdicts.
VISIBLE = 1.5

Sizes = Mapping[str, float]
#: A constant besides changes no other parameter.
SINES = ("sine", "sine with level")
EXPONENTIALS = ("exponential", "exponential with level")
LINES = ("line", "line with level")


@dataclass(frozen=True)
class Kind:
    """A cause, and what is right to say of it.

    Parameters
    ----------
    balances : tuple of str
        Balances in which it acts; one of them, or both mass flows, is right.
    drivers : tuple of str
        Drivers that are right.
    truth : callable
        From the sizes of the cause to the parameters of its formula, where that has one.
    formulas : tuple of str
        Formulas whose parameters can be compared with the truth.
    """

    balances: tuple[str, ...]
    drivers: tuple[str, ...]
    truth: Callable[[Sizes], Sizes] = lambda sizes: {}
    formulas: tuple[str, ...] = (*SINES, *EXPONENTIALS, *LINES)


FORCE, FLOWS = ("force",), ("mass_flow_P", "mass_flow_N")
MEASUREMENT = ("measurement_x", "measurement_P", "measurement_N")
KINDS = {
    "cogging": Kind(FORCE, ("x",), lambda s: {"amplitude": s["A"], "period": s["pitch"]}),
    "vibration": Kind(FORCE, ("t",), lambda s: {"amplitude": s["A"], "period": 1 / s["f"]}),
    "supply_pulsation": Kind(
        FLOWS, ("t",), lambda s: {"amplitude": s["share"], "period": 1 / s["f"]}
    ),
    "position_nonlinearity": Kind(
        MEASUREMENT, ("x",), lambda s: {"amplitude": s["A"], "period": s["pitch"]}
    ),
    "flow_drift": Kind(FLOWS, ("t",)),
    "pressure_crosstalk": Kind(MEASUREMENT, ("p_other",), lambda s: {"slope": s["share"]}),
    "magnetic_latch": Kind(FORCE, ("x",), lambda s: {"decay": -s["reach"]}),
    "periodic_leak": Kind(("mass_flow_P",), ("x",), lambda s: {"period": s["pitch"]}),
    "square_root_friction": Kind(FORCE, ("v",)),
    "friction_fade": Kind(FORCE, ("t",), lambda s: {"height": -s["delta_F"], "decay": s["tau"]}),
    "spring_load": Kind(FORCE, ("x",)),
    "quadratic_drag": Kind(FORCE, ("v",)),
    "pressure_friction": Kind(FORCE, ("p_mean", "p_P", "p_N")),
    "leakage_P": Kind(("mass_flow_P",), ("p",)),
}
#: Causes of the catalogue on axes where no term may be discovered.
LISTED = ("none", "stribeck", "valve_dead_zone", "leakage_P", "spring_load", "none")


def one_unlisted(job: tuple[str, int], duration: float) -> dict[str, Any]:
    """Return what is told of one cause on one axis."""
    logging.disable(logging.WARNING)
    name, seed = job
    kind = KINDS[name]
    with tempfile.TemporaryDirectory() as scratch:
        made = make_case(Path(scratch) / "case", seed, {name: SEVERITY}, duration=duration)
        options, _ = resolve_flow_form(made.case, IdentifyOptions())
        study, _ = prepare_study(made.case, options)
    nominal, levels = fit_model(study, ()), balance_levels(study)
    sizes = dict(made.effects[0].parameters)
    term = discovered(study)
    right = term is not None and _is_right(kind, term)
    return {
        "kind": name,
        "seed": seed,
        "sizes": sizes,
        "visible": bool(np.any(residual_rms(nominal) > VISIBLE * levels.noise)),
        "discovered": None if term is None else term.as_dict(),
        "right": right,
        "errors_percent": _errors(kind, sizes, term) if right and term is not None else {},
    }


def _is_right(kind: Kind, term: DiscoveredTerm) -> bool:
    return set(term.term.balances) <= set(kind.balances) and term.term.driver in kind.drivers


def _errors(kind: Kind, sizes: Sizes, term: DiscoveredTerm) -> dict[str, float]:
    """Return by how much the parameters differ from the truth, where the formula has them."""
    told = term.term.parameters if term.term.formula in kind.formulas else {}
    truth = kind.truth(sizes)
    return {name: 100 * (told[name] / value - 1) for name, value in truth.items() if name in told}


def one_listed(job: tuple[str, int], duration: float) -> dict[str, Any]:
    """Return the verdict on an axis with nothing unlisted."""
    logging.disable(logging.WARNING)
    name, seed = job
    with tempfile.TemporaryDirectory() as scratch:
        effects = {} if name == "none" else {name: "medium"}
        made = make_case(Path(scratch) / "case", seed, effects, duration=duration)
        diagnosis = diagnose(made.case)
    term = diagnosis.discovered
    return {
        "kind": name,
        "seed": seed,
        "verdict": diagnosis.verdict.value,
        "discovered": None if term is None else term.as_dict(),
    }


def figures(unlisted: list[dict[str, Any]], listed: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the shares that the benchmark asks for, over the causes that show."""
    shown = [case for case in unlisted if case["visible"]]
    closures = [0.0 if c["discovered"] is None else _closure(c) for c in shown]
    errors = [abs(error) for case in shown for error in case["errors_percent"].values()]
    return {
        "causes": len(unlisted),
        "visible": len(shown),
        "kinds": len({case["kind"] for case in unlisted}),
        "right_driver": float(np.mean([case["right"] for case in shown])),
        "median_closure": float(np.median(closures)),
        "parameters_within_10_percent": float(np.mean(np.array(errors) < 10)) if errors else None,
        "nothing_unlisted": len(listed),
        "false_terms": sum(case["discovered"] is not None for case in listed),
    }


def _closure(case: Mapping[str, Any]) -> float:
    return float(case["discovered"]["closes"]["value"])


def main() -> None:
    """Run the benchmark from the command line."""
    arguments = _arguments()
    duration = QUICK_DURATION if arguments.quick else DURATION
    kinds = list(KINDS)[:2] if arguments.quick else list(arguments.kinds or KINDS)
    axes = 1 if arguments.quick else arguments.axes
    jobs = [
        (name, SEED + 100 * i + j)
        for i, name in enumerate(KINDS)
        if name in kinds
        for j in range(axes)
    ]
    others = [(name, SEED + 5000 + i) for i, name in enumerate(LISTED)]
    others = others[:1] if arguments.quick else others[: arguments.listed]
    with ProcessPoolExecutor(arguments.workers) as pool:
        unlisted, listed = [], []
        for case in pool.map(partial(one_unlisted, duration=duration), jobs):
            unlisted.append(case)
            print(_line(case), flush=True)
        for case in pool.map(partial(one_listed, duration=duration), others):
            listed.append(case)
            print(case["kind"], case["seed"], case["verdict"], case["discovered"], flush=True)
    result = {
        "figures": figures(unlisted, listed),
        "unlisted": unlisted,
        "nothing_unlisted": listed,
        **provenance.made(SEED, arguments.quick),
    }
    provenance.write(arguments.json, result)
    for name, value in result["figures"].items():
        print(f"{name}: {value}")


def _line(case: Mapping[str, Any]) -> str:
    term = case["discovered"]
    told = (
        "nothing"
        if term is None
        else f"{term['balance']}: {term['formula']}, closes {term['closes']['value']:.2f}"
    )
    errors = ", ".join(f"{name} {value:+.1f} %" for name, value in case["errors_percent"].items())
    right = "right" if case["right"] else "WRONG" if case["visible"] else "not visible"
    return f"{case['kind']} {case['seed']}: {right}; {told} {errors}"


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="file to write")
    parser.add_argument("--quick", action="store_true", help="two kinds, short records")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--axes", type=int, default=2, help="axes for each kind")
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), help="only these")
    parser.add_argument(
        "--listed",
        type=int,
        default=len(LISTED),
        help="axes with nothing unlisted, diagnosed whole",
    )
    return parser.parse_args()


if __name__ == "__main__":
    main()
