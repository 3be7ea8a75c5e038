"""Question: does the toolbox identify what laboratories own, and name what they do wrong.

Data: five random axes of the virtual bench a situation, 10 s at 1 kHz to identify on and 10 s held
out, with the sensors' noise; twenty where one error is shared by all parameters of an axis. A
situation is met where every estimate is within its tolerance: M 0.5 %, X_s 3 %, f_v 10 %, F_c 5 %;
where a source of the flow is missing M 1 %, X_s 3 %, and the rest within 2.5 intervals. `coverage`
is the share of all parameters of all axes within their 95 % interval, `usable` the worst verdict on
a result. Then mistakes with records and maps: what the first line of `identify --strict` says, and
its exit code.
"""

import argparse
import os
import tempfile
import warnings
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import provenance
from laboratory_mistakes import DURATION, MISTAKES, commit
from laboratory_situations import METERED, SITUATIONS, Situation
from tables.laboratories import worst_of

from pneumo_casadi.data import read_case
from pneumo_casadi.errors import PneumoError
from pneumo_casadi.identification.identify import identify
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.virtual_bench import make_case, random_axis

SEED = 18
AXES = 5
#: Half-width of a 95 % interval, and how many of these an error may be where a source is missing.
INTERVAL, INTERVALS = 1.96, 2.5
LEAST_COVERAGE = 0.9
USABLE = ("yes", "with care", "no")
#: Windows of the held-out record [s]: those on which the verdict rests.
OPTIONS = IdentifyOptions(windows=(2.0,))
#: Returns the figures of a situation or a mistake on the axis of a seed.
_Make = Callable[[str, int], dict[str, Any]]
#: Situations whose estimates are compared.
UNIFORM, JITTER = "metered, two 3/2 valves", "jitter of 10 % and gaps"


def identify_axis(name: str, seed: int) -> dict[str, Any]:
    """Return the estimates of one axis in a situation, or the message of what failed."""
    situation = SITUATIONS[name]
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a clipped start is no news here
        path = Path(folder) / "case"
        axis = situation.axis(random_axis(seed))
        made = make_case(
            path, seed, duration=DURATION, axis=axis, laboratory=situation.laboratory(axis)
        )
        try:
            if situation.change is not None:
                situation.change(path, made.axis)
            result = identify(read_case(path), OPTIONS)
        except (PneumoError, ValueError, ArithmeticError, LookupError, TypeError) as error:
            return {"seed": seed, "failed": f"{type(error).__name__}: {error}"[:300]}
    frame = result.to_frame()
    known = [n for n in made.axis.truth if n in frame.index]
    return {
        "seed": seed,
        "usable": result.usability.usable.value,
        "verdict": result.usability.sentence,
        "severe": [w.text for w in result.warnings if w.grade.value == "severe"],
        "parameters": {
            n: {
                "truth": made.axis.truth[n],
                "value": float(frame.output_error[n]),
                "std": float(frame.output_error_std[n]),
            }
            for n in known
        },
        "seconds": result.seconds,
    }


def judge(name: str, rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return worst errors, coverage and verdict of a situation, and what misses its tolerance."""
    done = [row for row in rows if "failed" not in row]
    missed = [f"axis {row['seed']}: {row['failed']}" for row in rows if "failed" in row]
    worst: dict[str, float] = {}
    covered = []
    for row in done:
        for parameter, each in row["parameters"].items():
            error = each["value"] / each["truth"] - 1
            away = abs(each["value"] - each["truth"])
            worst[parameter] = max(worst.get(parameter, 0.0), abs(100 * error))
            covered.append(away <= INTERVAL * each["std"])
            limit = tolerance(SITUATIONS[name], parameter)
            if limit is None:
                if away > INTERVALS * INTERVAL * each["std"]:
                    missed.append(f"axis {row['seed']}: {parameter} beyond 2.5 intervals")
            elif abs(error) > limit:
                missed.append(f"axis {row['seed']}: {parameter} {100 * error:+.2g} %")
        missed += [f"axis {row['seed']}: severe: {text}"[:160] for text in row["severe"]]
    coverage = float(np.mean(covered)) if covered else 0.0
    if coverage < LEAST_COVERAGE:
        missed.append(f"coverage {100 * coverage:.0f} %")
    verdicts = [row["usable"] for row in done] + ["no"] * (len(rows) - len(done))
    return {
        "worst_error_percent": worst,
        "coverage": coverage,
        "usable": max(verdicts, key=USABLE.index),
        "met": not missed,
        "missed": missed,
        "axes": rows,
    }


def tolerance(situation: Situation, parameter: str) -> float | None:
    """Return the largest relative error of a parameter; None where its interval counts."""
    limits = situation.tolerances
    return next((limit for name, limit in limits.items() if parameter.startswith(name)), None)


def apart(uniform: Iterable[Mapping[str, Any]], jitter: Iterable[Mapping[str, Any]]) -> float:
    """Return how many intervals the estimates from two kinds of record are apart at most."""
    widths = [
        abs(each["value"] - first["parameters"][parameter]["value"]) / (INTERVAL * each["std"])
        for first, second in zip(uniform, jitter, strict=True)
        if "failed" not in first and "failed" not in second
        for parameter, each in second["parameters"].items()
    ]
    return float(max(widths, default=np.inf))


def _kept(keep: Path | None, make: _Make, name: str, seed: int) -> dict[str, Any]:
    return provenance.kept(
        keep, f"{name}, axis {seed}".replace("/", "-"), partial(make, name, seed)
    )


def run(
    axes: int, names: list[str], mistakes: list[str], workers: int, keep: Path | None = None
) -> dict[str, Any]:
    """Return the benchmark's figures; finished axes are taken from the folder `keep`."""
    with ProcessPoolExecutor(workers) as executor:

        def submit(
            make: Callable[[str, int], dict[str, Any]], name: str, few: Iterable[int]
        ) -> Any:
            return [executor.submit(_kept, keep, make, name, seed) for seed in few]

        waiting = {
            n: submit(identify_axis, n, range(SEED, SEED + axes * SITUATIONS[n].axes))
            for n in names
        }
        asked = {n: submit(commit, n, [SEED]) for n in mistakes}
        situations = {}
        for name, futures in waiting.items():
            situations[name] = judge(name, [future.result() for future in futures])
            print_situation(name, situations[name])
        committed = {}
        for name, futures in asked.items():
            committed[name] = [future.result() for future in futures]
            print_mistake(name, committed[name])
    result = {"axes": axes, "duration_s": DURATION, "situations": situations}
    if {UNIFORM, JITTER} <= situations.keys():
        uniform, jitter = (situations[name]["axes"] for name in (UNIFORM, JITTER))
        result["jitter_apart_in_intervals"] = apart(uniform, jitter)
        print(f"jitter: at most {result['jitter_apart_in_intervals']:.2f} intervals from uniform")
    return result | {"mistakes": committed}


def print_situation(name: str, judged: Mapping[str, Any]) -> None:
    """Print one row of the table, and below it what was missed."""
    worst = judged["worst_error_percent"]
    groups = {group: worst_of(worst, group) for group in METERED}
    figures = "  ".join(f"{group} {value:6.2f} %" for group, value in groups.items())
    state = "met" if judged["met"] else "missed"
    print(
        f"{name:36s} {figures}  coverage {100 * judged['coverage']:3.0f} %  "
        f"usable: {judged['usable']:9s}  {state}",
        flush=True,
    )
    for text in judged["missed"]:
        print(f"    {text}", flush=True)


def print_mistake(name: str, rows: list[dict[str, Any]]) -> None:
    """Print the first line and the exit code of a mistake."""
    for row in rows:
        state = "met" if row["met"] else "missed"
        print(f"{name:24s} exit {row['exit_code']}  {state}  {row['first_line']}", flush=True)


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="one axis, two situations")
    parser.add_argument("--only", nargs="*", help="names of situations and mistakes, or parts")
    parser.add_argument("--axes", type=int, default=AXES, help="axes a situation")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--keep", type=Path, help="keep finished axes here, and take them up again")
    arguments = parser.parse_args()
    if arguments.keep is not None:
        arguments.keep.mkdir(parents=True, exist_ok=True)
    parts = arguments.only if arguments.only is not None else [""]
    names = [n for n in SITUATIONS if any(part in n for part in parts)]
    mistakes = [n for n in MISTAKES if any(part in n for part in parts)]
    if arguments.quick:
        names, mistakes = [UNIFORM, "vertical, 10 kg"], ["bar for Pa"]
    axes = 1 if arguments.quick else arguments.axes
    result = run(axes, names, mistakes, arguments.workers, arguments.keep)
    result |= provenance.made(SEED, arguments.quick, "numba")
    provenance.write(arguments.json, result)


if __name__ == "__main__":
    main()
