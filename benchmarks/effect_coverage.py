"""Question: do the intervals of a diagnosis' effects cover the truth.

Data: records of the package's own model with one effect each, the axis of Table 1 in closed loop,
20 s to identify on and 12 s held out at 1 kHz, with white or coloured sensor noise and a flow map
metered with noise, anew for each seed, without and with a recorded disturbance (pulses added to the
commands); the size of the effect is drawn. Model and data have the same form of the effect: what is
measured are the intervals, not what another form does to them.
Each case is diagnosed with the effect as the only candidate. Counted is how often the printed 95 %
interval of each of its parameters covers the truth.
"""

import argparse
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import provenance
import tables
from own_model import metered_case, truth
from wls_vs_output_error import replicates, under_both_noises

from pneumo_casadi.diagnosis import diagnose
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.estimation.statistics import interval_factor
from pneumo_casadi.evaluation.sealed_check.tally import Share
from pneumo_casadi.model.effect import Effect

SEED = 20261124
#: Seconds to identify on, and held out.
IDENTIFY, VALIDATE = 20.0, 12.0
#: Typical sizes [SI]; those of a case are drawn from two thirds to three halves of them.
SIZES: Mapping[str, Mapping[str, float]] = {
    "spring_load": {"k": 150.0},
    "quadratic_drag": {"c": 60.0},
    "stribeck": {"delta_F": 12.0, "v_stribeck": 0.02},
    "pressure_friction": {"k_p": 2e-5},
    "elastic_load": {"m_2": 4.0, "f": 12.0, "zeta": 0.05},
    "valve_dynamics": {"tau": 5e-3, "zeta": 0.7},
    "valve_null_shift": {"u_0P": 0.05, "u_0N": -0.05},
    "leakage_P": {"C": 2e-10},
    "piston_seal_leakage": {"C": 2e-10},
    "pressure_sensor_lag": {"tau": 4e-3},
}


def one_case(correlation: float, job: tuple[str, int], disturbed: bool = False) -> dict[str, Any]:
    """Return truth, estimate and claimed standard deviation of one effect's parameters."""
    name, seed = job
    rng = np.random.default_rng([SEED, round(10 * correlation), list(SIZES).index(name), seed])
    sizes = {key: size * rng.uniform(2 / 3, 3 / 2) for key, size in SIZES[name].items()}
    effect: Effect = EFFECTS[name]()
    clean = truth()
    own = {f"{name}.{key}": size for key, size in sizes.items()}
    true = replace(clean, axis=clean.axis.with_effects(effect).with_parameters(own))
    with tempfile.TemporaryDirectory() as folder:
        lengths = (IDENTIFY, VALIDATE)
        case = metered_case(clean, true, lengths, Path(folder), rng, correlation, disturbed)
        diagnosis = diagnose(case, {name: EFFECTS[name]})
    found = diagnosis.effects[0].parameters if diagnosis.effects else {}
    return {
        "effect": name,
        "seed": seed,
        "verdict": diagnosis.verdict.value,
        "parameters": {
            key: {"truth": sizes[key], "value": found[key].value, "std": found[key].std}
            for key in sizes
            if key in found
        },
    }


def study(
    cases: int, correlation: float, executor: Executor, disturbed: bool = False
) -> dict[str, Any]:
    """Return coverage by effect and of all, with one kind of noise."""
    jobs = [(name, seed) for seed in range(cases) for name in SIZES]
    each = replicates(partial(one_case, disturbed=disturbed), jobs, correlation, executor)
    return {
        "cases": len(each),
        "named": Share.among(case["verdict"] == "effect" for case in each).as_dict(),
        **covered(each, "effect", SIZES),
    }


def covered(each: Sequence[Mapping[str, Any]], label: str, names: Iterable[str]) -> dict[str, Any]:
    """Return how often intervals cover the truth, of all cases and by what they hold."""
    factor = interval_factor(0.95)
    answers = {
        name: [
            abs(item["value"] - item["truth"]) <= factor * item["std"]
            for case in each
            if case[label] == name
            for item in case["parameters"].values()
        ]
        for name in names
    }
    return {
        "coverage": Share.among(chain(*answers.values())).as_dict(),
        f"by_{label}": {name: Share.among(given).as_dict() for name, given in answers.items()},
        "each": list(each),
    }


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--cases", type=int, default=12, help="cases of each effect")
    parser.add_argument("--quick", action="store_true", help="one case of each effect")
    arguments = parser.parse_args()
    cases = 1 if arguments.quick else arguments.cases
    result = under_both_noises(study, cases)
    result["disturbed"] = under_both_noises(partial(study, disturbed=True), cases)
    result |= provenance.made(SEED, arguments.quick)
    print(tables.effect_coverage(result))
    provenance.write(arguments.json, result)


if __name__ == "__main__":
    main()
