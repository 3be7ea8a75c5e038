"""Question: which of two estimators tells the truth about a servo axis, and about its own doubt.

Data: closed-loop records of the package's own model (Table 1 of the paper, 4 s at 1 kHz, chirp and
squares) with sensor noise in the loop, white or coloured, and a flow map metered with noise; anew
for each seed, without and with a recorded disturbance (pulses added to the commands). Coloured
noise correlates by 0.8 from sample to sample (first order, 4.5 ms). Friction is Coulomb's (smoothed
over 1 µm/s), which the fit smooths over 5 µm/s.
Weighted least squares (WLS) and multiple-shooting output error (OE) estimate the same record; OE
starts from WLS and estimates the flow map and the initial state as well.

Figures per parameter: bias and spread of the estimates, the standard deviation that the estimator
claims, how often its 95 % interval covers the truth, and, under white noise, the root mean square
error over the Cramér-Rao bound (the square root of the inverse information at the truth). Output
error claims two: one that believes in white noise, one robust to correlation; tables print the
wider of the two.
"""

import argparse
import logging
import os
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import provenance
import tables
from matplotlib.figure import Figure
from own_model import (
    NOISE_MAP,
    NOISE_P,
    NOISE_X,
    RATIOS,
    TABLE_1,
    metered,
    nominal,
    record_with_noise,
    true_values,
    truth,
)
from rich.progress import track

from pneumo_casadi.estimation.flow_anchor import anchor_to_flow_map
from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.estimation.output_error.information import estimate_uncertainty
from pneumo_casadi.estimation.output_error.shooting.problem import Unknowns, shoot_segments
from pneumo_casadi.estimation.output_error.solvers.solution import Solution
from pneumo_casadi.estimation.output_error.stages import write_problem
from pneumo_casadi.estimation.statistics import delta_std, interval_factor
from pneumo_casadi.estimation.wls import fit_wls

Given, Seed = TypeVar("Given"), TypeVar("Seed")

SEED = 20050704
#: Correlation of neighbouring noise samples in the coloured case.
CORRELATION = 0.8
#: Width of the friction in the data, next to that of Coulomb's law [m/s]. ...
SHARP = 1e-6
#: ... and in the fit: what it biases is a third of a standard deviation, where the default width
#: biases five to eight, which its intervals contain.
WIDTH = 5e-6


def one_seed(
    correlation: float, seed: int, disturbed: bool = False, width: float = WIDTH
) -> dict[str, Any]:
    """Return estimates and claimed standard deviations of both estimators for one seed."""
    rng = np.random.default_rng([SEED, round(10 * correlation), seed])
    true = truth(SHARP)
    record = record_with_noise(true, rng, correlation=correlation, disturbed=disturbed)
    table = metered(true, rng)
    axis = nominal(true, table)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a clipped start is no news here
        wls = fit_wls(axis, [record])
    options = OutputErrorOptions(widths=(width,))
    oe = fit_output_error(axis.started_at(wls.parameters), [record], table, options)
    wls_std = dict(zip(wls.parameters.names, wls.std, strict=True))
    results = {
        "wls": {name: (wls.parameters[name].value, wls_std[name]) for name in TABLE_1},
        "output_error": {n: (oe.parameters[n].value, oe.std(n)) for n in oe.uncertainty.names},
        "output_error_robust": {
            n: (oe.parameters[n].value, oe.std(n, robust=True)) for n in oe.uncertainty.names
        },
        "output_error_printed": {},
        "iterations": oe.iterations,
        "stages": len(oe.stages),
    }
    ratios = wls.derived.as_dict()
    for k in RATIOS:
        derived = oe.derived[k]
        results["wls"][k] = (ratios[k]["value"], ratios[k]["std"])
        results["output_error"][k] = (derived.value, derived.std)
        results["output_error_robust"][k] = (derived.value, derived.std_robust)
    for name, (value, std) in results["output_error"].items():
        wider = max(std, results["output_error_robust"][name][1])
        results["output_error_printed"][name] = (value, wider)
    return results


def bound(width: float) -> dict[str, float]:
    """Return the Cramér-Rao bound of every parameter's standard deviation, white noise."""
    rng = np.random.default_rng(SEED)
    true = truth(SHARP)
    record = record_with_noise(true, rng)
    table = metered(true, rng)
    problem = write_problem(true.axis, [record], table, OutputErrorOptions(widths=(width,)))
    # The bound knows the noise of the metering; the axis' flow was fitted to another table.
    exact = true.axis.flow(true.u, true.p)
    noise = NOISE_MAP * float(np.abs(exact).max())
    problem = replace(problem, anchor=anchor_to_flow_map(table, true.axis.flow, noise))
    start = problem.start()
    nodes, m = shoot_segments(problem, start.theta, true.x_0[:, None])
    sigma = np.array([NOISE_P, NOISE_P, NOISE_X])
    at_truth = Solution(Unknowns(start.theta, nodes), m, sigma, "true", 0)
    uncertainty = estimate_uncertainty(problem, at_truth, [record])
    values = true.axis.parameters.as_dict()
    least = dict(zip(uncertainty.names, uncertainty.std.tolist(), strict=True))
    for k, (upper, lower) in RATIOS.items():
        slopes = {upper: 1 / values[lower], lower: -values[upper] / values[lower] ** 2}
        gradient = np.array([slopes.get(name, 0.0) for name in uncertainty.names])
        least[k] = delta_std(gradient, uncertainty.covariance)
    return least


def run(seeds: Iterable[int], executor: Executor, width: float = WIDTH) -> dict[str, Any]:
    """Return the benchmark's figures over seeds."""
    chosen = list(seeds)
    least = bound(width)
    white = study(chosen, 0.0, executor, width)
    for key in ("wls", "output_error"):
        for name, item in white[key].items():
            item["rms_error_over_bound"] = item["rms_error"] / least[name]
    return {
        **white,
        "coloured": {"correlation": CORRELATION, **study(chosen, CORRELATION, executor, width)},
        "disturbed": {
            "white": study(chosen, 0.0, executor, width, disturbed=True),
            "coloured": study(chosen, CORRELATION, executor, width, disturbed=True),
        },
    }


def study(
    seeds: list[int],
    correlation: float,
    executor: Executor,
    width: float = WIDTH,
    disturbed: bool = False,
) -> dict[str, Any]:
    """Return the figures of all replicates with one kind of noise."""
    one = partial(one_seed, disturbed=disturbed, width=width)
    result = replicates(one, seeds, correlation, executor)
    values = true_values()
    keys = ("wls", "output_error", "output_error_robust", "output_error_printed")
    return {
        "replicates": len(result),
        **{key: {n: figures(result, key, n, values) for n in result[0][key]} for key in keys},
        "iterations": {
            "median": float(np.median([item["iterations"] for item in result])),
            "most": max(item["iterations"] for item in result),
        },
        "recovered_starts": sum(item["stages"] > 1 for item in result),
    }


def under_both_noises(
    study: Callable[[Given, float, Executor], dict[str, Any]], given: Given
) -> dict[str, Any]:
    """Return what a study finds under white and under coloured noise; its workers log nothing."""
    with ProcessPoolExecutor(
        os.cpu_count(), initializer=logging.disable, initargs=(logging.WARNING,)
    ) as executor:
        return {
            "white": study(given, 0.0, executor),
            "coloured": study(given, CORRELATION, executor),
        }


def replicates(
    one_seed: Callable[[float, Seed], dict[str, Any]],
    seeds: Sequence[Seed],
    correlation: float,
    executor: Executor,
) -> list[dict[str, Any]]:
    """Return what one seed gives, for all seeds with one kind of noise."""
    mapped = executor.map(partial(one_seed, correlation), seeds)
    label = "coloured noise" if correlation else "white noise"
    return list(track(mapped, label, total=len(seeds)))


def figures(
    result: list[dict[str, Any]], estimator: str, name: str, values: Mapping[str, float]
) -> dict[str, float]:
    """Return truth, bias, spread, claimed deviation and coverage of one parameter."""
    estimates, claimed = np.array([item[estimator][name] for item in result]).T
    error = estimates - values[name]
    covered = np.abs(error) <= interval_factor(0.95) * claimed
    return {
        "truth": values[name],
        "bias": float(error.mean()),
        "bias_percent": float(100 * error.mean() / abs(values[name])),
        "spread": float(error.std(ddof=1)),
        "rms_error": float(np.sqrt(np.mean(error**2))),
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
        bias = np.array([item["bias_percent"] for item in part])
        spread = np.array([100 * item["spread"] / abs(item["truth"]) for item in part])
        style: dict[str, Any] = {
            "color": colour,
            "marker": marker,
            "markersize": 3.5,
            "label": label,
        }
        left.errorbar(bias, rows + shift, xerr=2 * spread, linestyle="none", linewidth=1, **style)
        right.plot(
            [item["coverage_percent"] for item in part], rows + shift, linestyle="none", **style
        )
    left.set_xscale("symlog", linthresh=0.1)
    left.axvline(0, color="0.6", linewidth=0.8)
    left.set_xlabel("bias ± 2 spread (% of truth)")
    left.set_yticks(rows, [name.replace("_s", "") for name in names])
    left.invert_yaxis()
    right.axvspan(93, 97, color="0.9")
    right.set_xlabel("coverage of 95 % intervals (%)")
    handles, labels = right.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2, fontsize=8)
    return figure


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--figure", type=Path, help="write the figure to this PNG file")
    parser.add_argument("--seeds", type=int, default=1200, help="number of replicates")
    parser.add_argument("--width", type=float, default=WIDTH, help="of the friction [m/s]")
    parser.add_argument("--quick", action="store_true", help="four replicates, to see it run")
    arguments = parser.parse_args()
    one_seed(0.0, 0)  # compiles what all processes then load
    with ProcessPoolExecutor(max_workers=os.cpu_count()) as executor:
        seeds = range(4 if arguments.quick else arguments.seeds)
        result = run(seeds, executor, arguments.width)
    result |= provenance.made(SEED, arguments.quick)
    print(tables.coverage(result))
    provenance.write(arguments.json, result)
    if arguments.figure is not None:
        draw(result).savefig(arguments.figure, dpi=200)


if __name__ == "__main__":
    main()
