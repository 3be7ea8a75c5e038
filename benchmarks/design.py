"""Question: is the gain that a design predicts real, on a bench that shares no equation with it.

Data: cases of the virtual bench, 6 s at 1 kHz of chirp and squares (axes of random_axis, counted
from 0). ISO 6358 map refined with its metered points as anchor, friction width 0.3 mm/s.

Precision: an axis without an effect is fitted; a reference of the same length is designed from that
fit (criterion D, common mode up to 0.1 V), recorded on the bench and fitted. Predicted is the ratio
of standard errors designed / recorded; real is the ratio of those that the two fits tell.

Separation: an axis with a hidden effect. Two models are fitted to the ordinary record and differ
little; a reference is designed to tell them apart, recorded with the same hidden effect, and both
are fitted to it. Told are the residuals of the wrong model over those of the right one (root mean
square over the outputs in the right one's own σ), and the predicted refitted distances. The cases
were chosen because their ordinary record is ambiguous; on other axes the same pair need not be.
"""

import argparse
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import gap
import numpy as np
import provenance

from pneumo_casadi.design import (
    Design,
    DesignOptions,
    default_limits,
    design_for_precision,
    design_to_separate,
    recorded_reference,
)
from pneumo_casadi.output_error import OutputErrorOptions, OutputErrorResult
from pneumo_casadi.recording import Case, Recording
from pneumo_casadi.testbed import Excitation, MadeCase, make_case, record

FS, DURATION, COMMON = 1000.0, 6.0, 0.1
WIDTH = 3e-4
NONE = "none"
#: Axis, hidden effect with its severity, the model that is wrong.
PAIRS = (
    (3, "valve_mismatch", "medium", NONE),
    (3, "pressure_sensor_bias", "medium", "valve_null_shift"),
)


def fitted(start: Any, case: Case, table: Any) -> OutputErrorResult:
    """Fit an axis by output error; a fit that fails ends the benchmark."""
    found = gap.output_error(start, case, table)
    if found.result is None or found.failure:
        raise RuntimeError(f"{case.folder}: {found.failure}")
    return found.result


def again(made: MadeCase, design: Design, seed: int) -> Case:
    """Record a designed reference on the same axis with the same hidden effects."""
    drive = Excitation(design.reference.x_ref, design.reference.common)
    found = record(
        made.axis, drive, made.effects, FS, design.options.duration, 100 + seed, "designed"
    )
    return replace(made.case, identify=(found,))


def options(axis: Any, table: Any, ordinary: Recording, tries: int) -> DesignOptions:
    """Return limits that follow from the bench, and the length of the search."""
    metered = float(np.abs(table.u).max())
    limits = default_limits(axis.bench, [ordinary], metered, COMMON)
    return DesignOptions(limits, ordinary.N / FS, evaluations=tries)


def within(design: Design, recorded: Recording) -> dict[str, float]:
    """Return the extremes of a record in shares of the limits."""
    limits = design.options.limits
    u = np.abs(recorded.stack(("u_P", "u_N")))
    p = recorded.stack(("p_P", "p_N"))
    return {
        "position": float(np.abs(recorded["x"]).max()) / limits.position,
        "command": float(u.max()) / limits.command,
        "p_min": float(p.min()) / limits.p_min,
        "p_max": float(p.max()) / limits.p_max,
    }


def precision(seed: int, duration: float, tries: int) -> dict[str, Any]:
    """Return predicted and real standard errors of one axis."""
    gap.OUTPUT_ERROR = OutputErrorOptions(widths=(WIDTH,))
    with tempfile.TemporaryDirectory() as scratch:
        made = make_case(Path(scratch) / "case", seed, duration=duration)
        before, _, table = gap.nominal(made.case)
        if before.result is None or before.failure:
            raise RuntimeError(f"axis {seed}: {before.failure}")
        now, ordinary = before.result, made.case.identify[0]
        chosen = options(now.axis, table, ordinary, tries)
        reference = recorded_reference(ordinary)
        design = design_for_precision(now.axis, [reference], table, now.sigma, chosen)
        case = again(made, design, seed)
        new = fitted(now.axis, case, table)
    assert design.precision is not None
    truth = made.axis.truth
    return {
        "gain": design.gain,
        "seconds": design.seconds,
        "sigma_ratio": (new.sigma / now.sigma).tolist(),
        "shares_of_limits": within(design, case.identify[0]),
        "held_by_bounds": [list(one.estimate.at_bound) for one in (now, new)],
        "parameters": {
            name: {
                "predicted": design.precision.ratio(name),
                "real": new.std(name) / now.std(name),
                "error_percent": [
                    100 * (one.parameters[name].value / truth[name] - 1) for one in (now, new)
                ],
            }
            for name in design.precision.names
        },
    }


def separation(
    seed: int, hidden: str, severity: str, wrong: str, duration: float, tries: int
) -> dict[str, Any]:
    """Return how far two models part on the ordinary record and on the designed one."""
    gap.OUTPUT_ERROR = OutputErrorOptions(widths=(WIDTH,))
    with tempfile.TemporaryDirectory() as scratch:
        made = make_case(Path(scratch) / "case", seed, {hidden: severity}, duration=duration)
        old, start, table, nominal = _both(made.case, hidden, wrong)
        ordinary = made.case.identify[0]
        chosen = options(start, table, ordinary, tries)
        axes = {name: found.axis for name, found in old.items()}
        design = design_to_separate(
            axes, nominal.axis, [recorded_reference(ordinary)], table, old[hidden].sigma, chosen
        )
        case = again(made, design, seed)
        new, *_ = _both(case, hidden, wrong)
    return {
        "seed": seed,
        "hidden": hidden,
        "sizes": dict(made.effects[0].parameters),
        "wrong": wrong,
        "distances": [one.as_dict() for one in design.distances],
        "seconds": design.seconds,
        "shares_of_limits": within(design, case.identify[0]),
        "wrong_over_right": [apart(found, hidden, wrong) for found in (old, new)],
        "sizes_found": [
            {
                name: found[hidden].parameters[name].value
                for name in found[hidden].parameters.names
                if name.startswith(hidden)
            }
            for found in (old, new)
        ],
    }


def apart(found: Mapping[str, OutputErrorResult], right: str, wrong: str) -> float:
    """Return the residuals of the wrong model over those of the right one."""
    return float(np.sqrt(np.mean((found[wrong].rms / found[right].rms) ** 2)))


def _both(
    case: Case, hidden: str, wrong: str
) -> tuple[dict[str, OutputErrorResult], Any, Any, OutputErrorResult]:
    before, start, table = gap.nominal(case)
    nominal = before.result
    if nominal is None:
        raise RuntimeError(f"{case.folder}: {before.failure}")
    found = {}
    for name in (hidden, wrong):
        one = before if name == NONE else gap.refit(name, before, start, case, table)
        if one.result is None or one.failure:
            raise RuntimeError(f"{case.folder}, {name}: {one.failure}")
        found[name] = one.result
    return found, start, table, nominal


def lines(result: Mapping[str, Any]) -> str:
    """Return the figures as lines of text."""
    told = []
    for seed, one in result["precision"].items():
        quotients = [p["real"] / p["predicted"] for p in one["parameters"].values()]
        told.append(
            f"axis {seed}: gain {one['gain']:.2f} predicted, real / predicted standard errors "
            f"{min(quotients):.2f} … {max(quotients):.2f}"
        )
    for one in result["separation"]:
        before, after = one["wrong_over_right"]
        distances = ", ".join(f"{d['before']:.0f} → {d['after']:.0f}" for d in one["distances"])
        told.append(
            f"axis {one['seed']}, {one['hidden']} or {one['wrong']}: wrong / right residuals "
            f"{before:.2f} → {after:.2f}, predicted distances {distances}"
        )
    return "\n".join(told)


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--seeds", type=int, default=4, help="axes for precision, from 0")
    parser.add_argument("--quick", action="store_true", help="one axis, one pair, few references")
    arguments = parser.parse_args()
    tries = (20, 20) if arguments.quick else (100, 80)
    seeds = range(1 if arguments.quick else arguments.seeds)
    result: dict[str, Any] = {"duration_seconds": DURATION, "common_V": COMMON}
    result["precision"], result["separation"] = {}, []
    for seed in seeds:
        result["precision"][str(seed)] = precision(seed, DURATION, tries[0])
        print(lines(result), flush=True)
    for pair in PAIRS[: 1 if arguments.quick else None]:
        result["separation"].append(separation(*pair, DURATION, tries[1]))
        print(lines(result), flush=True)
    result |= provenance.made(None, arguments.quick) | {"seed": list(seeds)}
    provenance.write(arguments.json, result)


if __name__ == "__main__":
    main()
