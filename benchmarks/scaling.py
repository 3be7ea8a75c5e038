"""Question: how do time and memory of an output-error fit grow with the length of the record.

Data: one closed-loop record of the package's own model (Table 1 of the paper, 5 kHz, chirp and
squares over and over) with white sensor noise in the loop, and a flow map metered with noise; its
first 5 to 600 s. All 31 parameters and the initial state are free; the start is weighted least
squares. Each fit runs in a process of its own, whose peak memory is measured, and three times.

The sweep is a compiled simulation of the whole record with the sensitivities of its states and
outputs, and nothing else; an iteration is a step of all unknowns and the linearisation at the point
where it leads, normal equations and scores included. Both are timed in turn in the process of the
fit, in two threads alike. Memory is the peak of that process alone.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import own_model
import provenance
import tables

from pneumo_casadi.data import InputHold, Recording
from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.estimation.output_error.shooting import interval
from pneumo_casadi.estimation.output_error.shooting.condensing import linearise
from pneumo_casadi.estimation.output_error.shooting.problem import Problem
from pneumo_casadi.estimation.output_error.solvers.condensed_step import apply_step, condensed_step
from pneumo_casadi.estimation.output_error.stages import write_problem
from pneumo_casadi.estimation.wls import fit_wls
from pneumo_casadi.model.machine_code.calls import call_with_arrays, mapped
from pneumo_casadi.model.machine_code.compilation import compile_functions
from pneumo_casadi.runtime.threads import one_thread
from pneumo_casadi.valve import FlowMap

SEED = 20050705
RATE = 5000.0
LENGTHS = (5.0, 10.0, 20.0, 40.0, 60.0, 120.0, 300.0, 600.0)
REPEATS = 3
#: Iterations and sweeps timed in turn.
TURNS = 9
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
    with np.load(folder / "data.npz") as data:
        t, q_m = data["t"], data["q_m"]
        channels = {n: data[n] for n in data.files if n not in ("t", "q_m")}
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
    # Of this process alone: `ru_maxrss` begins with the memory of the one that started it.
    status = Path("/proc/self/status").read_text("utf-8")
    peak = 1024 * float(status.split("VmHWM:")[1].split()[0])
    names = own_model.TABLE_1
    iteration_s, sweep_s = iteration_and_sweep(result.axis, records, table, options)
    return {
        "seconds": seconds,
        "wls_s": wls_seconds,
        "wall_s": seconds + wls_seconds,
        "peak_GB": peak / GIGA,
        "iterations": result.iterations,
        "solve_s": sum(stage.seconds for stage in result.stages),
        "iteration_s": iteration_s,
        "sweep_s": sweep_s,
        "status": result.status,
        "estimates": {name: result.parameters[name].value for name in names},
        "std": {name: result.std(name) for name in names},
    }


@one_thread  # as the fit: threads of the linear algebra that wait would take its processors
def iteration_and_sweep(
    axis: Any, records: list[Recording], table: FlowMap, options: Any
) -> tuple[float, float]:
    """Time a Gauss-Newton iteration and a sweep of the record in turn [s], medians."""
    problem = write_problem(axis, records, table, options)
    start, data = problem.start(), problem.data
    sigma = np.array([own_model.NOISE_P, own_model.NOISE_P, own_model.NOISE_X])
    plain = mapped(compile_functions([sweep_function(problem)])[0], problem.I)
    theta = np.tile(start.theta[:, None], problem.I)
    at = linearise(problem, start, sigma)
    call_with_arrays(plain, start.x, data.w, theta, data.h)
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(TURNS):
        began = time.perf_counter()
        step = condensed_step(problem, at, start, sigma)
        assert step is not None
        linearise(problem, apply_step(problem, start, step), sigma)
        times[0].append(time.perf_counter() - began)
        began = time.perf_counter()
        call_with_arrays(plain, start.x, data.w, theta, data.h)
        times[1].append(time.perf_counter() - began)
    return statistics.median(times[0]), statistics.median(times[1])


def sweep_function(problem: Problem) -> ca.Function:
    """Return an interval's states, outputs and sensitivities alone, (x, w, θ, h) → (x, ȳ, S)."""
    model, n, B = problem.model, problem.n, problem.functions.blocks
    ny, m = len(model.axis.outputs), model.nx + len(problem.free)
    sample = interval._sample(model, problem.free)
    x, S = ca.MX.sym("x", model.nx), ca.MX.sym("S", model.nx, m)
    w, h = ca.MX.sym("w", model.nw, n), ca.MX.sym("h")
    theta = ca.MX.sym("theta", len(model.axis.parameters))
    end, S_end, total, J = x, S, ca.MX.zeros(ny), ca.MX.zeros(ny, m)
    for i in range(n):
        end, S_end, total, J = sample(end, S_end, total, J, w[:, i], theta, h)
    block = ca.Function("sweep_block", [x, S, w, h, theta], [end, S_end, total / n, J / n])
    chain = interval._chain("sweep_chain", block, B, carried=2, streams=2)
    W, H = ca.MX.sym("w", model.nw, n * B), ca.MX.sym("h", 1, B)
    end, S_end, means, _ = chain.call([x, ca.MX(interval._identity(model.nx, m)), W, H, theta])
    return ca.Function("sweep", [x, W, theta, H], [end, means, S_end])


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
    keys = ("seconds", "wall_s", "wls_s", "solve_s", "iteration_s", "sweep_s", "peak_GB")
    result = {key: statistics.median(run[key] for run in runs) for key in keys}
    ratios = [run["iteration_s"] / run["sweep_s"] for run in runs]
    return {
        "length_s": length,
        "samples": round(length * RATE),
        "records": pieces,
        **result,
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
        result = {length: measured(folder, length) for length in lengths}
        split = measured(folder, lengths[-1], 6)
    x = np.log([length_result["length_s"] for length_result in result.values()])
    y = np.log([item["seconds"] for item in result.values()])
    whole = result[lengths[-1]]
    apart = {
        name: abs(split["estimates"][name] - whole["estimates"][name]) / whole["std"][name]
        for name in whole["estimates"]
    }
    return {
        "exponent": float(np.polyfit(x, y, 1)[0]),
        "iteration_over_sweep": max(item["iteration_over_sweep"] for item in result.values()),
        "records": list(result.values()),
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
    print(tables.scaling(result))
    provenance.write(arguments.json, result)


if __name__ == "__main__":
    main()
