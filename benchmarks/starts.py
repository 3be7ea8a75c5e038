"""Question: from how far away does the output-error fit still find its optimum.

Data: a closed-loop record of the package's own model (Table 1 of the paper, 4 s at 1 kHz, chirp
and squares) with white sensor noise in the loop, and a flow map metered with noise. All 31
parameters are free; 100 starts have every one of them multiplied by a factor drawn evenly from
0.5 to 1.5, the coefficients of the flow map included. A start counts if it ends within a
hundredth of a standard deviation of the optimum that weighted least squares leads to.
"""

import argparse
import os
import warnings
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import own_model
import provenance

from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_from_many_starts
from pneumo_casadi.estimation.wls import fit_wls

SEED = 20050706
SPREAD = 0.5
#: Difference to the optimum in standard deviations of a parameter that counts as none.
SAME = 0.01


def run(starts: int) -> dict[str, Any]:
    """Return the benchmark's figures."""
    rng = np.random.default_rng(SEED)
    true = own_model.truth()
    record = own_model.record_with_noise(true, rng)
    table = own_model.metered(true, rng)
    axis = own_model.nominal(true, table)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a clipped start is no news here
        wls = fit_wls(axis, [record])
    begin = axis.started_at(wls.parameters)
    options = OutputErrorOptions(widths=(own_model.V_S,))
    with ProcessPoolExecutor(os.cpu_count()) as executor:
        result = fit_from_many_starts(
            begin, [record], table, options, starts + 1, SPREAD, SEED, executor
        )
    own, *others = result.outcomes
    assert own.result is not None
    names, std = own.result.uncertainty.names, own.result.uncertainty.std
    optimum = np.array([own.result.parameters[name].value for name in names])
    rows = []
    for outcome in others:
        apart = np.inf
        if outcome.result is not None:
            values = np.array([outcome.result.parameters[name].value for name in names])
            apart = float(np.max(np.abs(values - optimum) / std))
        rows.append(
            {
                "status": outcome.status,
                "cost": outcome.cost,
                "apart_in_std": apart,
                "reached": bool(apart < SAME),
                "stages": 0 if outcome.result is None else len(outcome.result.stages),
                "iterations": 0 if outcome.result is None else outcome.result.iterations,
                "seconds": outcome.seconds,
            }
        )
    return {
        "starts": starts,
        "spread": SPREAD,
        "free": len(names),
        "reached": sum(row["reached"] for row in rows),
        "optimum_cost": own.cost,
        "median_iterations": float(np.median([row["iterations"] for row in rows])),
        "recovered": sum(row["stages"] > 1 for row in rows),
        "outcomes": rows,
    }


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="ten starts, to see it run")
    arguments = parser.parse_args()
    result = run(10 if arguments.quick else 100)
    result |= provenance.made(SEED, arguments.quick)
    print(
        f"{result['reached']} of {result['starts']} starts within ±50 % reach the optimum, "
        f"median {result['median_iterations']:g} iterations, {result['recovered']} recovered"
    )
    for row in result["outcomes"]:
        if not row["reached"]:
            print(row)
    provenance.write(arguments.json, result)


if __name__ == "__main__":
    main()
