"""Question: when is output error biased, the loop simulated or the input taken as measured.

Data: closed-loop records of the package's own model (Table 1 of the paper, 4 s at 1 kHz, chirp and
squares), the flow map known, in four situations: white sensor noise; sensor noise that correlates
by 0.95 from sample to sample; a disturbance of the valve command that nobody records (0.02 V,
slower than 3 Hz); a controller gain stated 5 % too high. Sensor noise is 150 Pa and 0.1 mm, so that
what the loop feeds back counts. X_s1 ... X_s6, M, f_v, F_c⁺, F_c⁻ are estimated, the loop open and
closed.

Figures: mean error in per cent of the truth, its standard error over the replicates, and spread.
"""

import argparse
import os
import warnings
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import own_model
import provenance
import tables
from scipy.signal import butter, sosfilt

from pneumo_casadi.data import InputHold, Recording
from pneumo_casadi.errors import FitError
from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.model.simulation import simulate_closed_loop

SEED = 20050707
NOISE_X = 1e-4
CORRELATION = 0.95
DISTURBANCE = 0.02
GAIN_ERROR = 1.05
SITUATIONS = ("white noise", "coloured noise", "unrecorded disturbance", "wrong controller gain")
LOOPS = {"open": False, "closed": True}


def made(situation: str, rng: np.random.Generator) -> Recording:
    """Simulate one record; the controller reads the noisy position."""
    true, x_ref = own_model.truth(), own_model.reference()
    N, gain = x_ref.size, true.axis.bench.controller.gain
    correlation = CORRELATION if situation == "coloured noise" else 0.0
    e = own_model.noise(NOISE_X, N, rng, correlation)
    fed_back = np.stack([-gain * e, gain * e], axis=1)
    hidden = np.zeros((N, 2))
    if situation == "unrecorded disturbance":
        slow = sosfilt(butter(2, 3.0, fs=own_model.RATE, output="sos"), rng.normal(size=N))
        hidden[:, 0] = DISTURBANCE * slow / slow.std()
        hidden[:, 1] = -hidden[:, 0]
    run = simulate_closed_loop(
        true.axis, x_ref, 1 / own_model.RATE, true.x_0, disturbance=fed_back + hidden
    )
    size = own_model.NOISE_P
    channels = {
        "u_P": run["u_P"] - hidden[:, 0],
        "u_N": run["u_N"] - hidden[:, 1],
        "p_P": run["p_P"] + own_model.noise(size, N, rng, correlation),
        "p_N": run["p_N"] + own_model.noise(size, N, rng, correlation),
        "x": run["x"] + e,
        "x_ref": x_ref,
    }
    return Recording(run.t, channels, "own model", "simulated", InputHold.ZERO)


def one_seed(situation: str, seed: int) -> dict[str, dict[str, float] | None]:
    """Return the errors in per cent of both estimators, None where a fit failed."""
    rng = np.random.default_rng([SEED, SITUATIONS.index(situation), seed])
    axis = own_model.truth().axis
    record = made(situation, rng)
    axis = axis.with_parameters(axis.parameters.fix(*axis.flow.parameters.names))
    if situation == "wrong controller gain":
        controller = axis.bench.controller
        stated = replace(controller, gain=GAIN_ERROR * controller.gain)
        axis = replace(axis, bench=replace(axis.bench, controller=stated))
    results: dict[str, dict[str, float] | None] = {}
    for loop, closed in LOOPS.items():
        options = OutputErrorOptions(closed_loop=closed, widths=(own_model.V_S,))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                fit = fit_output_error(axis, [record], options=options)
        except FitError:
            results[loop] = None
            continue
        results[loop] = {
            n: 100 * (fit.parameters[n].value / truth - 1) for n, truth in own_model.TABLE_1.items()
        }
    return results


def run(seeds: int) -> dict[str, Any]:
    """Return the benchmark's figures."""
    result: dict[str, Any] = {"replicates": seeds, "situations": {}}
    with ProcessPoolExecutor(os.cpu_count()) as executor:
        for situation in SITUATIONS:
            replicates = list(executor.map(partial(one_seed, situation), range(seeds)))
            result["situations"][situation] = {loop: _figures(replicates, loop) for loop in LOOPS}
    return result


def _figures(replicates: list[dict[str, dict[str, float] | None]], loop: str) -> dict[str, Any]:
    kept = [replicate[loop] for replicate in replicates if replicate[loop] is not None]
    errors = {
        name: np.array([errors_of_replicate[name] for errors_of_replicate in kept])
        for name in own_model.TABLE_1
    }
    return {
        "failed": len(replicates) - len(kept),
        "bias_percent": {n: float(e.mean()) for n, e in errors.items()},
        "bias_standard_error": {n: float(e.std(ddof=1) / len(e) ** 0.5) for n, e in errors.items()},
        "spread_percent": {n: float(e.std(ddof=1)) for n, e in errors.items()},
    }


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="four replicates, to see it run")
    arguments = parser.parse_args()
    one_seed(SITUATIONS[0], 0)  # compiles what all processes then load
    result = run(4 if arguments.quick else 60)
    result |= provenance.made(SEED, arguments.quick)
    print(tables.loops(result))
    provenance.write(arguments.json, result)


if __name__ == "__main__":
    main()
