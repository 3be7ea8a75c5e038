"""Question: how long do the tools of the field take for one and the same estimation problem.

Data: closed-loop records of the package's own model (Table 1 of the paper, chirp and squares) with
white sensor noise in the loop. X_s1 ... X_s6, M, f_v, F_c⁺, F_c⁻ and the initial state are free;
inputs hold over each sample; all tools start from weighted least squares and from smoothed
measured states. Three problems: 4 s at 1 kHz; 40 windows of 0.5 s, each with an initial state of
its own; 60 s at 5 kHz, where the 21 coefficients of the flow map are free too and its metered
points belong to the cost. Elsewhere the flow map is known.

Each tool runs in a process of its own, one after another. Three times are taken of each:

- cold: from the start of a process to the answer, nothing compiled beforehand; imports, building
  and solving all count;
- warm: building and solving once more in that process;
- restart: from the start of a second process to the answer, with what the first one has compiled.

What a tool finds is simulated anew by fine Runge-Kutta steps in plain Python: the cost in the table
is that simulation's, whatever the tool itself discretises. A tool has reached the optimum if
its cost is within 0.1 % of the best. What fails stays in the table.

Run it with the interpreter of an environment that holds the extra ``peers`` (see pyproject.toml).
"""

import argparse
import json
import statistics
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import provenance
import tables.speed
from peer_tools.estimation import Estimation
from peer_tools.judging import MECHANICAL, cost
from peer_tools.problems import KINDS, SEED
from peer_tools.processes import failed, runs_of
from peer_tools.run import PATIENCE

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
    "JAX": ("jax_single", "single shooting by a scan, forward tangents, Levenberg-Marquardt"),
    "JAX, multiple shooting": ("jax_shooting", "intervals by vmap, condensed Gauss-Newton"),
    "numba + SciPy": ("numba_scipy", "single shooting, sensitivities by hand, least_squares"),
    "numba, multiple shooting": ("numba_shooting", "by hand, condensed Gauss-Newton, threads"),
    "acados": ("with_acados", "multiple shooting, parameters as states, HPIPM"),
}
#: The problem that all tools are given; the larger ones are for those that solve it fast.
COMMON = "common"
LARGE = (
    "pneumo_casadi",
    "JAX",
    "JAX, multiple shooting",
    "numba + SciPy",
    "numba, multiple shooting",
)
#: The same problem by other solvers of CasADi.
SOLVERS = {
    "condensed Gauss-Newton": ("ours", "block sweep to a dense problem in the parameters"),
    "IPOPT": ("ours_ipopt", "sparse program, Gauss-Newton Hessian, MUMPS"),
    "sqpmethod": ("solver_sqp", "Gauss-Newton Hessian, quadratic programs by HPIPM stage by stage"),
    "fatrop": ("solver_fatrop", "exact Hessian, interpreted, stage by stage"),
}
OURS = "pneumo_casadi"
#: Packages of the rivals whose versions the result names.
PACKAGES = ("jax", "numba")
#: Share of the best cost within which the optimum counts as reached.
REACHED = 1e-3
#: Time for one run of a larger problem [s].
LARGE_LIMIT = 60.0
#: Reasons other than their time on the common problem.
LEFT_OUT = {"acados": "written for one record, a stage for every sample"}
#: How the times are called, and the runs that they come from.
TIMES = ("cold", "warm", "restart")


@dataclass(frozen=True)
class Bar:
    """How long a tool may take, and how often it runs."""

    limit: float
    repeats: int


def measure(tools: Mapping[str, tuple[str, str]], given: Estimation, bar: Bar) -> dict[str, Any]:
    """Run all tools in turn, the quick ones several times; return medians and accuracy."""
    runs: dict[str, list[dict[str, Any]]] = {name: [] for name in tools}
    for turn in range(bar.repeats):
        for name, (module, _) in tools.items():
            if turn and (failed(runs[name][-1]) or runs[name][-1]["whole_s"] > PATIENCE):
                continue
            runs[name].append(runs_of(module, given, bar.limit))
            last = runs[name][-1]
            times = [last.get(key) for key in ("whole_s", "again_s", "restart_s")]
            shown = ", ".join("-" if t is None else f"{t:.2f} s" for t in times)
            told = last.get("failure") or f"{shown}, {last['status']}"
            print(f"{turn + 1}/{bar.repeats} {name}: {told}", flush=True)
    return {name: _row(given, runs[name], tools[name][1]) for name in tools}


def _seconds(run: Mapping[str, Any]) -> float:
    return float(run["build_s"] + run["solve_s"])


def _row(given: Estimation, runs: list[dict[str, Any]], formulation: str) -> dict[str, Any]:
    """Return one row of the table from a tool's runs."""
    last = runs[-1]
    if failed(last):
        return {"formulation": formulation, "reached": False, **last}

    def median(key: str) -> float | None:
        values = [run[key] for run in runs if run.get(key) is not None]
        return statistics.median(values) if values else None

    errors = 100 * (np.array(last["theta"]) / given.truth - 1)[:MECHANICAL]
    worst = int(np.argmax(np.abs(errors)))
    return {
        "version": last["version"],
        "formulation": formulation,
        "cold_s": median("whole_s"),
        "warm_s": median("again_s"),
        "restart_s": median("restart_s"),
        "import_s": median("import_s"),
        "build_s": median("build_s"),
        "solve_s": median("solve_s"),
        "total_s": statistics.median(map(_seconds, runs)),
        "runs": [_seconds(run) for run in runs],
        "cpu_s": median("cpu_s"),
        "peak_GB": median("peak_GB"),
        "cost": cost(given, last["theta"], last["x_0"]),
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


def speed_ups(tools: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the same for each of the three times, of tools that reach the optimum."""
    result: dict[str, Any] = {}
    for time_ in TIMES:
        seconds = {
            name: row[f"{time_}_s"]
            for name, row in tools.items()
            if row["reached"] and row.get(f"{time_}_s") is not None
        }
        ours = seconds.pop(OURS, None)
        fastest = min(seconds, key=lambda name: seconds[name], default=None)
        known = ours is not None and fastest is not None
        result[f"speed_up_{time_}"] = seconds[fastest] / ours if known else None
        result[f"fastest_{time_}"] = fastest
    return result


def left_out(common: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return rows of the tools that the larger problems leave out, with the reason."""
    rows: dict[str, Any] = {}
    for name, row in common.items():
        if name in LARGE:
            continue
        if "failure" in row:
            told = f"the common problem: {row['failure']}"
        else:
            told = f"the common problem takes it {row.get('cold_s', row['total_s']):.0f} s"
        reason = LEFT_OUT.get(name, told)
        failure = f"left out: {reason}"
        rows[name] = {"formulation": row["formulation"], "reached": False, "failure": failure}
    return rows


def larger(name: str, chosen: Mapping[str, tuple[str, str]], bar: Bar, quick: bool) -> Any:
    """Return the rows of a larger problem and what they amount to."""
    given = KINDS[name].make(quick)
    large = {tool: chosen[tool] for tool in LARGE if tool in chosen}
    tools = measure(large, given, Bar(min(bar.limit, LARGE_LIMIT), bar.repeats))
    best = judge(tools.values())
    return {**about(name, given), "best_cost": best, **speed_ups(tools), "tools": tools}


def about(name: str, given: Estimation) -> dict[str, Any]:
    """Return what a problem consists of."""
    return {
        "title": KINDS[name].title,
        "samples": given.N,
        "windows": given.windows,
        "parameters": len(given.names),
    }


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each quick tool")
    parser.add_argument("--limit", type=float, default=600.0, help="time for one run [s]")
    parser.add_argument("--only", nargs="*", help="these tools and solvers alone")
    parser.add_argument(
        "--problems",
        nargs="*",
        choices=KINDS,
        default=list(KINDS),
        help="these alone; the others are kept as --json has them",
    )
    parser.add_argument("--quick", action="store_true", help="half a second, once, to see it run")
    arguments = parser.parse_args()
    bar = Bar(arguments.limit, 1 if arguments.quick else arguments.repeats)

    def chosen(tools: Mapping[str, tuple[str, str]]) -> dict[str, tuple[str, str]]:
        wanted = arguments.only or tools
        return {name: tool for name, tool in tools.items() if name in wanted}

    path, result = arguments.json, {}
    if set(arguments.problems) != set(KINDS) and path is not None and path.exists():
        result = json.loads(path.read_text("utf-8"))
    problems = result.pop("problems", {})
    for name in arguments.problems:
        print(f"{name}: {KINDS[name].title}", flush=True)
        if name != COMMON:
            problems[name] = larger(name, chosen(TOOLS), bar, arguments.quick)
            continue
        given = KINDS[name].make(arguments.quick)
        tools = measure(chosen(TOOLS), given, bar)
        solvers = measure(chosen(SOLVERS), given, bar)
        best = judge([*tools.values(), *solvers.values()])
        problems[name] = {**about(name, given), "best_cost": best, **speed_ups(tools)}
        result |= {**speed_up(tools), "best_cost": best, "samples": given.N}
        result |= {"limit_s": arguments.limit, "tools": tools, "solvers": solvers}
    for name, problem in problems.items():
        if name != COMMON:
            problem["tools"] |= left_out(result.get("tools", {}))
    result["problems"] = {name: problems[name] for name in KINDS if name in problems}
    result |= provenance.made(SEED, arguments.quick, *PACKAGES)
    print(*(tables.speed.problem(result, name) for name in result["problems"]), sep="\n\n")
    provenance.write(path, result)


if __name__ == "__main__":
    main()
