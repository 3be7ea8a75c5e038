"""Question: which of two estimators tells the truth about a servo axis, and about its own doubt.

Data: closed-loop records of the package's own model (Table 1 of the paper, 4 s at 1 kHz, chirp and
squares) with white sensor noise in the loop, and a flow map metered with noise; anew for each seed.
Weighted least squares (WLS) and multiple-shooting output error (OE) estimate the same record; OE
starts from WLS and estimates the flow map and the initial state as well.

Figures per parameter: bias and spread of the estimates, the standard deviation that the estimator
claims, and how often its 95 % interval covers the truth.
"""

import argparse
import json
import os
import platform
import warnings
from collections.abc import Iterable, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import readme
import scipy
from matplotlib.figure import Figure
from rich.progress import track
from scipy.signal import chirp, square

from pneumo_casadi import __version__
from pneumo_casadi.axis import Axis
from pneumo_casadi.flow import FlowMap, fit_polynomials, read_flow_map
from pneumo_casadi.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.recording import InputHold, Recording, load_case
from pneumo_casadi.regression import fit_wls
from pneumo_casadi.report import paper
from pneumo_casadi.servosystem import Servosystem
from pneumo_casadi.simulation import simulate_closed_loop
from pneumo_casadi.statistics import interval_factor

SEED = 20050704
RATE = 1000.0
DURATION = 4.0
NOISE_P, NOISE_X = 150.0, 1.5e-5
#: Noise of one metered flow, as a share of the largest [1].
NOISE_MAP = 0.002
#: Width of the smoothed friction, in data and fit alike [m/s].
V_S = 1e-3
TABLE_1 = {name: value for name, (value, _) in paper.TABLE_1.items()}
RATIOS = {"k_P": ("X_s3", "X_s2"), "k_N": ("X_s6", "X_s5")}


@dataclass(frozen=True)
class Truth:
    """The axis that makes the data, and where its flow map is metered."""

    axis: Axis
    u: FloatArray
    p: FloatArray
    x_0: FloatArray


def truth() -> Truth:
    """Return the axis of Table 1 with the polynomials of the embedded flow map."""
    case = load_case(Path(str(resources.files("pneumo_casadi"))) / "data" / "table1")
    table = read_flow_map(case.flow_map_path)
    axis = Servosystem(case.bench, fit_polynomials(table)).with_parameters({**TABLE_1, "v_s": V_S})
    record = case.identify[0]
    x_0 = np.array([record["p_P"][:50].mean(), record["p_N"][:50].mean(), 0.0, 0.0])
    return Truth(axis, table.u, table.p, x_0)


def reference() -> FloatArray:
    """Return a chirp of 0-2 Hz, then squares of two amplitudes [m]."""
    t = np.arange(round(DURATION * RATE)) / RATE
    half = DURATION / 2
    sweep = 0.12 * chirp(t, 0.0, half, 2.0, phi=-90)
    steps = np.where(t < 1.5 * half, 0.06, 0.13) * square(2 * np.pi * 1.0 * t)
    return np.where(t < half, sweep, steps)


def record_with_noise(true: Truth, rng: np.random.Generator) -> Recording:
    """Simulate one record; the controller reads the noisy position."""
    axis, x_ref = true.axis, reference()
    e = rng.normal(0.0, NOISE_X, x_ref.size)
    gain = axis.bench.controller.gain
    through_loop = np.stack([-gain * e, gain * e], axis=1)
    run = simulate_closed_loop(axis, x_ref, 1 / RATE, true.x_0, disturbance=through_loop)
    channels = {
        "u_P": run["u_P"],
        "u_N": run["u_N"],
        "p_P": run["p_P"] + rng.normal(0.0, NOISE_P, x_ref.size),
        "p_N": run["p_N"] + rng.normal(0.0, NOISE_P, x_ref.size),
        "x": run["x"] + e,
        "x_ref": x_ref,
    }
    return Recording(run.t, channels, "own model", "simulated", InputHold.ZERO)


def one_seed(seed: int) -> dict[str, Any]:
    """Return estimates and claimed standard deviations of both estimators for one seed."""
    rng = np.random.default_rng([SEED, seed])
    true = truth()
    record = record_with_noise(true, rng)
    exact = true.axis.flow(true.u, true.p)
    metered = exact + rng.normal(0.0, NOISE_MAP * np.abs(exact).max(), exact.size)
    bench = true.axis.bench
    table = FlowMap(true.u, true.p, metered, bench.p_supply, bench.p_ext)
    axis = Servosystem(bench, fit_polynomials(table)).with_parameters({"v_s": V_S})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a clipped start is no news here
        wls = fit_wls(axis, [record])
    start = axis.started_at(wls.parameters)
    oe = fit_output_error(start, [record], table, OutputErrorOptions(widths=(V_S,)))
    wls_std = dict(zip(wls.parameters.names, wls.std, strict=True))
    found = {
        "wls": {name: (wls.parameters[name].value, wls_std[name]) for name in TABLE_1},
        "output_error": {n: (oe.parameters[n].value, oe.std(n)) for n in oe.estimate.names},
        "output_error_robust": {
            n: (oe.parameters[n].value, oe.std(n, robust=True)) for n in oe.estimate.names
        },
        "iterations": oe.iterations,
        "stages": len(oe.stages),
    }
    ratios = wls.derived.as_dict()
    for k in RATIOS:
        found["wls"][k] = (ratios[k]["value"], ratios[k]["std"])
        found["output_error"][k] = (oe.derived[k].value, oe.derived[k].std)
    return found


def run(seeds: Iterable[int], executor: Executor) -> dict[str, Any]:
    """Return the benchmark's figures over seeds."""
    chosen = list(seeds)
    found = list(track(executor.map(one_seed, chosen), "seeds", total=len(chosen)))
    values = truth().axis.parameters.as_dict()
    values |= {k: values[a] / values[b] for k, (a, b) in RATIOS.items()}
    return {
        "replicates": len(found),
        "wls": {name: figures(found, "wls", name, values) for name in found[0]["wls"]},
        **{
            key: {name: figures(found, key, name, values) for name in found[0][key]}
            for key in ("output_error", "output_error_robust")
        },
        "iterations": {
            "median": float(np.median([one["iterations"] for one in found])),
            "most": max(one["iterations"] for one in found),
        },
        "recovered_starts": sum(one["stages"] > 1 for one in found),
    }


def figures(
    found: list[dict[str, Any]], estimator: str, name: str, values: Mapping[str, float]
) -> dict[str, float]:
    """Return truth, bias, spread, claimed deviation and coverage of one parameter."""
    estimates, claimed = np.array([one[estimator][name] for one in found]).T
    error = estimates - values[name]
    covered = np.abs(error) <= interval_factor(0.95) * claimed
    return {
        "truth": values[name],
        "bias": float(error.mean()),
        "bias_percent": float(100 * error.mean() / abs(values[name])),
        "spread": float(error.std(ddof=1)),
        "claimed_std": float(np.sqrt(np.mean(claimed**2))),
        "coverage_percent": float(100 * covered.mean()),
    }


def draw(result: Mapping[str, Any]) -> Figure:
    """Draw bias and spread in claimed deviations, and coverage, for both estimators."""
    names = [*TABLE_1, *RATIOS]
    rows = np.arange(len(names))
    figure = Figure(figsize=(7.2, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    styles = (("wls", "WLS", "#D55E00", "s", 0.15), ("output_error", "OE", "#0072B2", "o", -0.15))
    for key, label, colour, marker, shift in styles:
        part = [result[key][name] for name in names]
        bias = np.array([one["bias_percent"] for one in part])
        spread = np.array([100 * one["spread"] / abs(one["truth"]) for one in part])
        style: dict[str, Any] = {
            "color": colour,
            "marker": marker,
            "markersize": 3.5,
            "label": label,
        }
        left.errorbar(bias, rows + shift, xerr=2 * spread, linestyle="none", linewidth=1, **style)
        right.plot(
            [one["coverage_percent"] for one in part], rows + shift, linestyle="none", **style
        )
    left.set_xscale("symlog", linthresh=0.1)
    left.axvline(0, color="0.6", linewidth=0.8)
    left.set_xlabel("bias ± 2 spread (% of truth)")
    left.set_yticks(rows, [name.replace("_s", "") for name in names])
    left.invert_yaxis()
    right.axvspan(92, 98, color="0.9")
    right.set_xlabel("coverage of 95 % intervals (%)")
    handles, labels = right.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2, fontsize=8)
    return figure


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--figure", type=Path, help="write the figure to this PNG file")
    parser.add_argument("--seeds", type=int, default=400, help="number of replicates")
    parser.add_argument("--quick", action="store_true", help="four replicates, to see it run")
    arguments = parser.parse_args()
    one_seed(0)  # compiles what all processes then load
    with ProcessPoolExecutor(max_workers=os.cpu_count()) as executor:
        result = run(range(4 if arguments.quick else arguments.seeds), executor)
    versions = {"pneumo_casadi": __version__, "casadi": casadi.CasadiMeta.version()}
    result |= {
        "machine": f"{platform.machine()} {platform.system()}, {os.cpu_count()} CPUs",
        "versions": versions | {"numpy": np.__version__, "scipy": scipy.__version__},
        "seed": SEED,
        "quick": arguments.quick,
    }
    print(readme.coverage(result))
    if arguments.json is not None:
        partial = arguments.json.with_suffix(".part")
        partial.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        partial.replace(arguments.json)
    if arguments.figure is not None:
        draw(result).savefig(arguments.figure, dpi=200)


if __name__ == "__main__":
    main()
