"""Question: do the intervals of weighted least squares cover the truth.

Data: as in `wls_vs_output_error.py`, records of the package's own model with white or coloured
sensor noise in the loop and a flow map metered with noise, anew for each seed, without and with a
recorded disturbance (pulses added to the commands). Figures per parameter: how often the 95 %
interval covers the truth, of eq. 16 of the paper, which believes in white residuals and an exact
map, and of the covariance that reports print, which allows for correlated residuals and contains
the noise of the map.
"""

import argparse
import warnings
from collections.abc import Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import provenance
import tables
from own_model import TABLE_1, metered, nominal, record_with_noise, true_values, truth
from wls_vs_output_error import figures, replicates, under_both_noises

from pneumo_casadi.estimation.wls import fit_wls

SEED = 20261123
#: Intervals by their name in the result, and the column of the estimates' table.
INTERVALS = {"eq_16": "std", "printed": "std_hac"}


def one_seed(correlation: float, seed: int, disturbed: bool = False) -> dict[str, Any]:
    """Return estimates and claimed standard deviations for one seed."""
    rng = np.random.default_rng([SEED, round(10 * correlation), seed])
    true = truth()
    record = record_with_noise(true, rng, correlation=correlation, disturbed=disturbed)
    axis = nominal(true, metered(true, rng))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a clipped start is no news here
        fit = fit_wls(axis, [record])
    frame = fit.to_frame()
    claimed = {
        key: {name: (frame["estimate"][name], frame[column][name]) for name in TABLE_1}
        for key, column in INTERVALS.items()
    }
    assert fit.derived is not None
    for name, item in fit.derived.as_dict().items():
        claimed["printed"][name] = (item["value"], item["std"])
    return claimed


def study(
    seeds: Sequence[int], correlation: float, executor: Executor, disturbed: bool = False
) -> dict[str, Any]:
    """Return the figures of all replicates with one kind of noise."""
    result = replicates(partial(one_seed, disturbed=disturbed), seeds, correlation, executor)
    values = true_values()
    return {
        key: {name: figures(result, key, name, values) for name in result[0][key]}
        for key in INTERVALS
    }


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--seeds", type=int, default=1200, help="number of replicates")
    parser.add_argument("--quick", action="store_true", help="four replicates, to see it run")
    arguments = parser.parse_args()
    seeds = range(4 if arguments.quick else arguments.seeds)
    result = {"replicates": len(seeds), **under_both_noises(study, seeds)}
    result["disturbed"] = under_both_noises(partial(study, disturbed=True), seeds)
    result |= provenance.made(SEED, arguments.quick)
    print(tables.wls_coverage(result))
    provenance.write(arguments.json, result)


if __name__ == "__main__":
    main()
