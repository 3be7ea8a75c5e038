"""Question: how do time and memory of an output-error fit grow with the length of the record.

Data: one closed-loop record of the package's own model (Table 1 of the paper, 5 kHz, chirp and
squares over and over) with white sensor noise in the loop, and a flow map metered with noise; its
first 5 to 60 s. All 31 parameters and the initial state are free; the start is weighted least
squares. Each fit runs in a process of its own, whose peak memory is measured, and three times.

The sweep is one call of the compiled function that simulates the whole record with the states'
sensitivities; it is timed in the process of the fit, and so is the iteration.
"""

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import own_model
import provenance
import readme

from pneumo_casadi.flow import FlowMap
from pneumo_casadi.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.output_error.condensing import linearise
from pneumo_casadi.output_error.fit import write_problem
from pneumo_casadi.output_error.problem import Unknowns
from pneumo_casadi.recording import InputHold, Recording
from pneumo_casadi.regression import fit_wls

SEED = 20050705
RATE = 5000.0
LENGTHS = (5.0, 10.0, 20.0, 40.0, 60.0)
REPEATS = 3
GIGA = 1e9


def make(folder: Path, longest: float) -> None:
    """Write the record and the map that all fits read."""
    rng = np.random.default_rng(SEED)
    true = own_model.truth()
    record = own_model.record_with_noise(true, rng, longest, RATE)
    table = own_model.metered(true, rng)
    channels = {name: record[name] for name in record.names}
    np.savez(folder / "data.npz", t=record.t, q_m=table.q_m, **channels)


def load(folder: Path, length: float, pieces: int) -> tuple[list[Recording], FlowMap]:
    """Return the first `length` seconds as one record, or cut into pieces, and the map."""
    true = own_model.truth()
    with np.load(folder / "data.npz") as found:
        t, q_m = found["t"], found["q_m"]
        channels = {n: found[n] for n in found.files if n not in ("t", "q_m")}
    bench = true.axis.bench
    table = FlowMap(true.u, true.p, q_m, bench.p_supply, bench.p_ext)
    N = round(length * RATE)
    record = Recording(
        t[:N], {n: v[:N] for n, v in channels.items()}, "own", "own model", InputHold.ZERO
    )
    cuts = np.linspace(0, N, pieces + 1).astype(int)
    records = [
        # The last sample of a record ends its last step: pieces share it.
        record.window(record.t[a], record.t[min(b, N - 1)] + 1 / RATE)
        for a, b in pairwise(cuts)
    ]
    return records, table


def fit_once(folder: Path, length: float, pieces: int) -> dict[str, Any]:
    """Fit one record in this process; return seconds, memory and what was found."""
    records, table = load(folder, length, pieces)
    true = own_model.truth()
    axis = own_model.nominal(true, table)
    began = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a clipped start is no news here
        wls = fit_wls(axis, records)
    start = axis.started_at(wls.parameters)
    options = OutputErrorOptions(widths=(own_model.V_S,))
    wls_seconds = time.perf_counter() - began
    began = time.perf_counter()
    result = fit_output_error(start, records, table, options)
    seconds = time.perf_counter() - began
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    names = own_model.TABLE_1
    return {
        "seconds": seconds,
        "wls_s": wls_seconds,
        "wall_s": seconds + wls_seconds,
        "peak_GB": peak / GIGA,
        "iterations": result.iterations,
        "solve_s": sum(stage.seconds for stage in result.stages),
        "sweep_s": sweep(result.axis, records, table, options),
        "status": result.status,
        "estimates": {name: result.parameters[name].value for name in names},
        "std": {name: result.std(name) for name in names},
    }


def sweep(axis: Any, records: list[Recording], table: FlowMap, options: Any) -> float:
    """Time one simulation of the record with its sensitivities [s], median of five."""
    problem = write_problem(axis, records, table, options)
    start = problem.start()
    point = Unknowns(start.theta, start.x)
    sigma = np.array([own_model.NOISE_P, own_model.NOISE_P, own_model.NOISE_X])
    times = []
    for _ in range(5):
        began = time.perf_counter()
        linearise(problem, point, sigma)
        times.append(time.perf_counter() - began)
    return statistics.median(times)


def measured(folder: Path, length: float, pieces: int = 1) -> dict[str, Any]:
    """Fit in processes of their own; return the medians."""
    runs = []
    for _ in range(REPEATS):
        command = [sys.executable, __file__, "--fit", str(folder), str(length), str(pieces)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise SystemExit(f"fit of {length:g} s failed:\n{done.stderr}")
        runs.append(json.loads(done.stdout.splitlines()[-1]))
        print(f"{length:g} s in {pieces}: {runs[-1]['seconds']:.1f} s", flush=True)
    keys = ("seconds", "wall_s", "wls_s", "solve_s", "sweep_s", "peak_GB")
    found = {key: statistics.median(run[key] for run in runs) for key in keys}
    ratios = [run["solve_s"] / run["iterations"] / run["sweep_s"] for run in runs]
    return {
        "length_s": length,
        "samples": round(length * RATE),
        "records": pieces,
        **found,
        "iterations": max(run["iterations"] for run in runs),
        "iteration_over_sweep": statistics.median(ratios),
        "status": runs[0]["status"],
        "estimates": runs[0]["estimates"],
        "std": runs[0]["std"],
    }


def run(lengths: tuple[float, ...]) -> dict[str, Any]:
    """Return the benchmark's figures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make(folder, lengths[-1])
        # In the order of length a machine that warms up would look like growth.
        found = {length: measured(folder, length) for length in lengths}
        split = measured(folder, lengths[-1], 6)
    x = np.log([one["length_s"] for one in found.values()])
    y = np.log([one["seconds"] for one in found.values()])
    whole = found[lengths[-1]]
    apart = {
        name: abs(split["estimates"][name] - whole["estimates"][name]) / whole["std"][name]
        for name in whole["estimates"]
    }
    return {
        "exponent": float(np.polyfit(x, y, 1)[0]),
        "iteration_over_sweep": max(one["iteration_over_sweep"] for one in found.values()),
        "records": list(found.values()),
        "six_records": {
            **split,
            "time_ratio": split["seconds"] / whole["seconds"],
            "memory_ratio": split["peak_GB"] / whole["peak_GB"],
            "largest_difference_in_std": max(apart.values()),
        },
    }


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="2 and 4 s, to see it run")
    parser.add_argument("--fit", nargs=3, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.fit:
        folder, length, pieces = arguments.fit
        print(json.dumps(fit_once(Path(folder), float(length), int(pieces))))
        return
    result = run((2.0, 4.0) if arguments.quick else LENGTHS)
    result |= provenance.made(SEED, arguments.quick)
    print(readme.scaling(result))
    provenance.write(arguments.json, result)


if __name__ == "__main__":
    main()
