"""Question: how long do the tools of the field take for one and the same estimation problem.

Data: a closed-loop record of the package's own model (Table 1 of the paper, 4 s at 1 kHz, chirp
and squares) with white sensor noise in the loop. X_s1 ... X_s6, M, f_v, F_c⁺, F_c⁻ and the initial
state are free; the flow map and the friction width are known; inputs hold over each sample; all
tools start from weighted least squares and from smoothed measured states.

Each tool runs in a process of its own, one after another, with nothing compiled beforehand; its
import is not counted. What it finds is simulated anew by fine Runge-Kutta steps in plain Python:
the cost in the table is that simulation's, whatever the tool itself discretises. A tool has
reached the optimum if its cost is within 0.1 % of the best. What fails stays in the table.

Run it with the interpreter of an environment that holds the extra ``peers`` (see pyproject.toml).
"""

import argparse
import json
import os
import pickle
import signal
import statistics
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import provenance
import tables.speed
from numpy.polynomial import Chebyshev, Polynomial
from own_model import DURATION, NOISE_P, NOISE_X, TABLE_1, V_S, record_with_noise, truth
from peer_tools.estimation import Estimation

from pneumo_casadi.estimation.output_error.shooting.segments import measured_states
from pneumo_casadi.estimation.wls import fit_wls
from pneumo_casadi.valve.polynomials import parts

#: Tools by name: module in `peer_tools`, and what the formulation is.
TOOLS = {
    "pneumo_casadi": ("ours", "condensed Gauss-Newton, multiple shooting, compiled"),
    "pyomo.dae + pyomo-pounce": ("with_pyomo", "Radau collocation on the sample grid"),
    "GEKKO": ("with_gekko", "moving-horizon mode, orthogonal collocation on the sample grid"),
    "opty": ("with_opty", "direct collocation by the midpoint rule, cyipopt"),
    "do-mpc": ("with_do_mpc", "one horizon of moving-horizon estimation, collocation, IPOPT"),
    "rockit": ("with_rockit", "multiple shooting with Runge-Kutta steps, IPOPT"),
    "SciPy least_squares": ("scipy_shooting", "single shooting in NumPy, differences in parallel"),
    "lmfit": ("lmfit_shooting", "single shooting in NumPy, differences in parallel"),
}
#: The same problem by other solvers of CasADi.
SOLVERS = {
    "condensed Gauss-Newton": ("ours", "block sweep to a dense problem in the parameters"),
    "IPOPT": ("ours_ipopt", "sparse program, Gauss-Newton Hessian, MUMPS"),
    "sqpmethod": ("solver_sqp", "Gauss-Newton Hessian, quadratic programs by HPIPM stage by stage"),
    "fatrop": ("solver_fatrop", "exact Hessian, interpreted, stage by stage"),
}
OURS = "pneumo_casadi"
SEED = 20050704
#: Share of the best cost within which the optimum counts as reached.
REACHED = 1e-3
#: Tools that took longer are not repeated [s].
PATIENCE = 60.0


def problem(duration: float) -> Estimation:
    """Return the problem: one record, cut to `duration` [s], and the start from WLS."""
    true = truth()
    record = record_with_noise(true, np.random.default_rng([SEED, 0]), duration)
    flow = true.axis.flow
    free = true.axis.with_parameters(true.axis.parameters.fix(*flow.parameters.names))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a clipped start is no news here
        axis = free.started_at(fit_wls(free, [record]).parameters)
    names = axis.parameters.free_names
    powers = [
        Chebyshev(flow.parameters.values[part]).convert(kind=Polynomial).coef
        for part in parts(flow.degrees).values()
    ]
    bench = true.axis.bench
    return Estimation(
        names,
        axis.parameters.select(names).values,
        np.array([TABLE_1[name] for name in names]),
        record.dt,
        record.stack(axis.inputs),
        record.stack(axis.outputs),
        measured_states(axis, record, axis.parameters).T,
        np.array([NOISE_P, NOISE_P, NOISE_X]),
        *powers,
        flow.p_range,
        {"S_P": bench.S_P, "S_N": bench.S_N, "p_ext": bench.p_ext, "v_s": V_S},
        pickle.dumps((axis, record)),
    )


@dataclass(frozen=True)
class Bar:
    """How long a tool may take, and how often it runs."""

    limit: float
    repeats: int


def one_run(module: str, given: Estimation, limit: float) -> dict[str, Any]:
    """Run one tool once in its own process and folder; return its answer or its failure."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        given.write(folder / "problem")
        cache = folder / "cache"
        cache.mkdir(mode=0o700)
        process = subprocess.Popen(
            [sys.executable, "-m", "peer_tools.run", module, name],
            cwd=Path(__file__).parent,
            env={**os.environ, "PNEUMO_CASADI_CACHE": str(cache), "TMPDIR": name},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        try:
            _, errors = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return {"failure": f"no answer within {limit:g} s"}
        answer = folder / "answer.json"
        if process.returncode or not answer.exists():
            lines = errors.strip().splitlines() or ["no message"]
            return {"failure": f"exit code {process.returncode}: {lines[-1]}"}
        content: dict[str, Any] = json.loads(answer.read_text())
        return content


def measure(tools: Mapping[str, tuple[str, str]], given: Estimation, bar: Bar) -> dict[str, Any]:
    """Run all tools in turn, the quick ones several times; return medians and accuracy."""
    runs: dict[str, list[dict[str, Any]]] = {name: [] for name in tools}
    for turn in range(bar.repeats):
        for name, (module, _) in tools.items():
            if turn and (_failed(runs[name][-1]) or _seconds(runs[name][-1]) > PATIENCE):
                continue
            runs[name].append(one_run(module, given, bar.limit))
            last = runs[name][-1]
            told = last.get("failure") or f"{_seconds(last):.2f} s, {last['status']}"
            print(f"{turn + 1}/{bar.repeats} {name}: {told}", flush=True)
    return {name: _row(given, runs[name], tools[name][1]) for name in tools}


def _failed(run: Mapping[str, Any]) -> bool:
    return "failure" in run


def _seconds(run: Mapping[str, Any]) -> float:
    return float(run["build_s"] + run["solve_s"])


def _row(given: Estimation, runs: list[dict[str, Any]], formulation: str) -> dict[str, Any]:
    """Return one row of the table from a tool's runs."""
    last = runs[-1]
    if _failed(last):
        return {"formulation": formulation, "reached": False, **last}

    def median(key: str) -> float:
        return statistics.median(run[key] for run in runs)

    errors = 100 * (np.array(last["theta"]) / given.truth - 1)
    worst = int(np.argmax(np.abs(errors)))
    return {
        "version": last["version"],
        "formulation": formulation,
        "import_s": median("import_s"),
        "build_s": median("build_s"),
        "solve_s": median("solve_s"),
        "total_s": statistics.median(map(_seconds, runs)),
        "runs": [_seconds(run) for run in runs],
        "peak_GB": median("peak_GB"),
        "cost": given.cost(last["theta"], last["x_0"]),
        "own_objective": last["objective"],
        "parameter_error_percent": float(np.abs(errors[worst])),
        "worst_parameter": given.names[worst],
        "parameter_error_rms_percent": float(np.sqrt(np.mean(errors**2))),
        "parameters": dict(zip(given.names, last["theta"], strict=True)),
        "iterations": last["iterations"],
        "status": last["status"],
    }


def judge(rows: Iterable[dict[str, Any]]) -> float:
    """Mark in every row whether the optimum was reached; return the best cost."""
    listed = list(rows)
    best = min((row["cost"] for row in listed if "cost" in row), default=float("nan"))
    for row in listed:
        row["reached"] = "cost" in row and row["cost"] <= best * (1 + REACHED)
    return float(best)


def speed_up(tools: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return how much longer than ours the fastest peer takes that reaches the optimum."""
    peers = {n: row["total_s"] for n, row in tools.items() if n != OURS and row["reached"]}
    ours = tools.get(OURS, {})
    if not peers or not ours.get("reached"):
        return {"fastest_peer": None, "speed_up_over_fastest_peer": None}
    fastest = min(peers, key=lambda name: peers[name])
    return {
        "fastest_peer": fastest,
        "speed_up_over_fastest_peer": peers[fastest] / ours["total_s"],
    }


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each quick tool")
    parser.add_argument("--limit", type=float, default=600.0, help="time for one run [s]")
    parser.add_argument("--only", nargs="*", help="these tools and solvers alone")
    parser.add_argument("--quick", action="store_true", help="half a second, once, to see it run")
    arguments = parser.parse_args()
    given = problem(0.5 if arguments.quick else DURATION)
    bar = Bar(arguments.limit, 1 if arguments.quick else arguments.repeats)

    def chosen(tools: Mapping[str, tuple[str, str]]) -> dict[str, tuple[str, str]]:
        wanted = arguments.only or tools
        return {name: tool for name, tool in tools.items() if name in wanted}

    tools = measure(chosen(TOOLS), given, bar)
    solvers = measure(chosen(SOLVERS), given, bar)
    best = judge([*tools.values(), *solvers.values()])
    result = {
        **speed_up(tools),
        "best_cost": best,
        "samples": given.N,
        "limit_s": arguments.limit,
        "tools": tools,
        "solvers": solvers,
        **provenance.made(SEED, arguments.quick),
    }
    print(tables.speed.tools(tools), tables.speed.tools(solvers), sep="\n\n")
    print(f"speed-up over {result['fastest_peer']}: {result['speed_up_over_fastest_peer']}")
    provenance.write(arguments.json, result)


if __name__ == "__main__":
    main()
