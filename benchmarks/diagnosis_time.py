"""Question: how long does one wait for a diagnosis.

Data: the practice cases (20 s at 1 kHz, one hidden effect each), their 60 s at 5 kHz, and draws of
the virtual bench as its sealed check draws them (20 s at 1 kHz, half of them with weak effects
besides). The whole catalogue is tried, on two processes, one case after the other.

Each case is diagnosed in a process of its own, whose start is not counted, with machine code at
hand; `cold_extra_s` is what it takes longer where the compiler's cache is empty. Practice cases are
diagnosed three times, of which the median counts. Of the draws, a form that nobody compiled before
is compiled within its time, as on a user's machine. With ``--keep`` an interrupted run goes on
where it was; a form that it has compiled is at hand then.
"""

import argparse
import statistics
import tempfile
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import provenance
from verdicts import AUTO, isolated

from pneumo_casadi.evaluation.sealed_check.draw import Draw, draw_cases, make

SEED = 22
REPEATS = 3
#: Practice cases diagnosed with an empty cache as well.
COLD = 3


def seconds_of(folder: Path, cold: bool = False) -> tuple[float, float]:
    """Return time [s] and peak memory [GB] of a diagnosis."""
    figures = isolated(folder, cold, AUTO)
    return figures["seconds"], figures["peak_GiB"] * 2**30 / 1e9


def one_practice_case(folder: Path, repeats: int, cold: bool) -> dict[str, Any]:
    """Return how long a case takes with machine code at hand, and with an empty cache."""
    seconds_of(folder)  # so that machine code is at hand
    runs = [seconds_of(folder) for _ in range(repeats)]
    warm = statistics.median(seconds for seconds, _ in runs)
    print(f"{folder.name}: {warm:.1f} s", flush=True)
    figures = {"seconds": warm, "peak_GB": max(peak for _, peak in runs)}
    return figures | ({"extra": seconds_of(folder, cold=True)[0] - warm} if cold else {})


def practice(source: Path, quick: bool, keep: Path) -> dict[str, Any]:
    """Diagnose the practice cases, some of them with an empty cache too."""
    folders = sorted(p for p in source.iterdir() if p.is_dir())
    (longest,) = [p for p in folders if p.name.endswith("60s")]
    folders.remove(longest)
    folders = folders[:1] if quick else folders
    repeats = 1 if quick else REPEATS

    def timed(folder: Path, repeats: int, cold: bool) -> dict[str, Any]:
        of = {"folder": str(folder.resolve()), "repeats": repeats, "cold": cold}
        work = partial(one_practice_case, folder, repeats, cold)
        return provenance.kept(keep, folder.name, work, of)

    each = {p.name: timed(p, repeats, number < COLD) for number, p in enumerate(folders)}
    figures = {
        "each": {name: case["seconds"] for name, case in each.items()},
        "median_s": statistics.median(case["seconds"] for case in each.values()),
        "cold_extra_s": max(case["extra"] for case in each.values() if "extra" in case),
        "peak_GB": max(case["peak_GB"] for case in each.values()),
    }
    if not quick:
        long = timed(longest, 1, cold=False)
        figures |= {"long_s": long["seconds"], "long_GB": long["peak_GB"]}
    return figures


def one_draw(draw: Draw) -> dict[str, Any]:
    """Return how long a draw of the virtual bench takes."""
    with tempfile.TemporaryDirectory() as scratch:
        make(draw, Path(scratch) / draw.name)
        seconds, peak = seconds_of(Path(scratch) / draw.name)
    print(f"{draw.name}: {seconds:.1f} s", flush=True)
    return {"seconds": seconds, "peak_GB": peak}


def draws(number: int, first: int | None, keep: Path) -> dict[str, Any]:
    """Diagnose draws of the virtual bench, or the first of them alone."""
    each = {
        draw.name: provenance.kept(keep, draw.name, partial(one_draw, draw), draw.as_dict())
        for draw in draw_cases(number, SEED)[:first]
    }
    seconds = {name: case["seconds"] for name, case in each.items()}
    return {
        "draws": seconds,
        "draws_median_s": statistics.median(seconds.values()),
        "draws_peak_GB": max(case["peak_GB"] for case in each.values()),
        "slowest_s": max(seconds.values()),
    }


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="holds practice/")
    parser.add_argument("--draws", type=int, default=160)
    parser.add_argument("--first", type=int, help="so many of the draws alone")
    parser.add_argument("--keep", type=Path, help="keep finished cases here, and go on there")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="one case and one draw, once each")
    arguments = parser.parse_args()
    with ExitStack() as stack:
        keep = arguments.keep or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        keep.mkdir(parents=True, exist_ok=True)
        figures = practice(arguments.data / "practice", arguments.quick, keep)
        figures |= draws(1 if arguments.quick else arguments.draws, arguments.first, keep)
    made = provenance.made(SEED, arguments.quick, "numba")
    print({key: value for key, value in figures.items() if not isinstance(value, dict)})
    provenance.write(arguments.json, made | figures)


if __name__ == "__main__":
    main()
