"""Question: how long does one wait for a diagnosis.

Data: the practice cases (20 s at 1 kHz, one hidden effect each), their 60 s at 5 kHz, and draws of
the virtual bench as its sealed check draws them (20 s at 1 kHz, half of them with weak effects
besides). The whole catalogue is tried, on two processes, one case after the other.

Each case is diagnosed in a process of its own, whose start is not counted, with machine code at
hand; `cold_extra_s` is what it takes longer where the compiler's cache is empty. Practice cases are
diagnosed three times, of which the median counts. Of the draws, a form that nobody compiled before
is compiled within its time, as on a user's machine.
"""

import argparse
import statistics
import tempfile
from pathlib import Path
from typing import Any

import provenance
from verdicts import AUTO, isolated

from pneumo_casadi.evaluation.sealed_check.draw import draw_cases, make

SEED = 22
REPEATS = 3
#: Practice cases diagnosed with an empty cache as well.
COLD = 3


def seconds_of(folder: Path, cold: bool = False) -> tuple[float, float]:
    """Return time [s] and peak memory [GB] of a diagnosis."""
    figures = isolated(folder, cold, AUTO)
    return figures["seconds"], figures["peak_GiB"] * 2**30 / 1e9


def practice(source: Path, quick: bool) -> dict[str, Any]:
    """Diagnose the practice cases, some of them with an empty cache too."""
    folders = sorted(p for p in source.iterdir() if p.is_dir())
    (longest,) = [p for p in folders if p.name.endswith("60s")]
    folders.remove(longest)
    folders = folders[:1] if quick else folders
    for folder in folders:  # so that machine code is at hand
        seconds_of(folder)
    each, peaks = {}, []
    for folder in folders:
        runs = [seconds_of(folder) for _ in range(1 if quick else REPEATS)]
        each[folder.name] = statistics.median(seconds for seconds, _ in runs)
        peaks += [peak for _, peak in runs]
        print(f"{folder.name}: {each[folder.name]:.1f} s", flush=True)
    extra = [seconds_of(p, cold=True)[0] - each[p.name] for p in folders[:COLD]]
    told = {
        "each": each,
        "median_s": statistics.median(each.values()),
        "cold_extra_s": max(extra),
        "peak_GB": max(peaks),
    }
    if not quick:
        told["long_s"], told["long_GB"] = seconds_of(longest)
    return told


def draws(number: int) -> dict[str, Any]:
    """Diagnose draws of the virtual bench."""
    seconds = {}
    with tempfile.TemporaryDirectory() as scratch:
        for draw in draw_cases(number, SEED):
            folder = Path(scratch) / draw.name
            make(draw, folder)
            seconds[draw.name] = seconds_of(folder)[0]
            print(f"{draw.name}: {seconds[draw.name]:.1f} s", flush=True)
    return {
        "draws": seconds,
        "draws_median_s": statistics.median(seconds.values()),
        "slowest_s": max(seconds.values()),
    }


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="holds practice/")
    parser.add_argument("--draws", type=int, default=160)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="one case and one draw, once each")
    arguments = parser.parse_args()
    figures = practice(arguments.data / "practice", arguments.quick)
    figures |= draws(1 if arguments.quick else arguments.draws)
    made = provenance.made(SEED, arguments.quick, "numba")
    print({key: value for key, value in figures.items() if not isinstance(value, dict)})
    provenance.write(arguments.json, made | figures)


if __name__ == "__main__":
    main()
