"""Question: do the intervals of discovered terms cover the truth.

Data: records of the package's own model with one term that no catalogue has, the axis of Table 1 in
closed loop, 20 s to identify on and 12 s held out at 1 kHz, with white or coloured sensor noise and
a flow map metered with noise, anew for each seed, without and with a recorded disturbance (pulses
added to the commands); the sizes of the term are drawn. What is
discovered without knowing the term is compared with it: how often balance, driver and formula are
right, and there, how often the printed 95 % interval of each parameter covers the truth.
"""

import argparse
import tempfile
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import provenance
import tables
from effect_coverage import IDENTIFY, VALIDATE, covered
from own_model import metered_case, truth
from wls_vs_output_error import replicates, under_both_noises

from pneumo_casadi.diagnosis import prepare_study
from pneumo_casadi.diagnosis.discover.discover import discover_term
from pneumo_casadi.diagnosis.discover.discovered import DiscoveredTerm
from pneumo_casadi.diagnosis.discover.term_in_model import fit_with_term, told_as_fitted
from pneumo_casadi.diagnosis.metrics.residual_size import balance_levels
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.diagnosis.prepare.noise_bias import without_noise_bias
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.effects.term.term import Term, term_effect
from pneumo_casadi.evaluation.sealed_check.tally import Share
from pneumo_casadi.identification.flow_form import resolve_flow_form
from pneumo_casadi.identification.options import IdentifyOptions

SEED = 20261125
#: Terms of typical size [SI]; parameters of a case are drawn from two thirds to three halves.
TERMS: Mapping[str, Term] = {
    term.name: term
    for term in (
        Term(
            "cogging", ("force",), "1", "x", "sine", {"amplitude": 8.0, "phase": 0, "period": 0.04}
        ),
        Term(
            "vibration", ("force",), "1", "t", "sine", {"amplitude": 6.0, "phase": 0, "period": 0.3}
        ),
        Term("spring", ("force",), "1", "x", "line", {"slope": -150.0}),
        Term("drag", ("force",), "sign(v)", "v", "square", {"square": -60.0}),
        Term("wear", ("force",), "sign(v)", "t", "line", {"slope": -0.5}),
        Term(
            "pulsation",
            ("mass_flow_P", "mass_flow_N"),
            "p_supply",
            "t",
            "sine",
            {"amplitude": 0.02, "phase": 0, "period": 0.5},
        ),
    )
}
#: Where a sine begins depends on when its record does.
NOT_COMPARED = ("phase",)


def one_case(correlation: float, job: tuple[str, int], disturbed: bool = False) -> dict[str, Any]:
    """Return truth, estimate and claimed standard deviation of one term's parameters."""
    name, seed = job
    rng = np.random.default_rng([SEED, round(10 * correlation), list(TERMS).index(name), seed])
    typical = TERMS[name]
    sizes = {key: size * rng.uniform(2 / 3, 3 / 2) for key, size in typical.parameters.items()}
    effect = term_effect(replace(typical, parameters=sizes))()
    clean = truth()
    own = {f"{name}.{key}": size for key, size in sizes.items()}
    true = replace(clean, axis=clean.axis.with_effects(effect).with_parameters(own))
    with tempfile.TemporaryDirectory() as folder:
        lengths = (IDENTIFY, VALIDATE)
        case = metered_case(clean, true, lengths, Path(folder), rng, correlation, disturbed)
        options, _ = resolve_flow_form(case, IdentifyOptions())
        study, _ = prepare_study(case, options)
    term = discovered(study)
    told = None if term is None else term.term
    driver = told is not None and (told.balances, told.driver) == (typical.balances, typical.driver)
    right = driver and told is not None and told.formula == typical.formula
    compared = [key for key in sizes if key not in NOT_COMPARED] if right else []
    return {
        "term": name,
        "seed": seed,
        "told": None if told is None else told.text,
        "driver": driver,
        "parameters": {
            key: {
                "truth": sizes[key],
                "value": term.parameters[key].value,
                "std": term.parameters[key].std,
            }
            for key in compared
            if term is not None
        },
    }


def discovered(study: Study) -> DiscoveredTerm | None:
    """Return the term that the nominal model lacks, as a diagnosis tells it."""
    nominal = fit_model(study, ())
    term = discover_term(study, nominal, (), balance_levels(study))
    if term is None:
        return None
    model = fit_with_term(study, term, (nominal, ()))
    return term if model is None else told_as_fitted(term, without_noise_bias(study, *model))


def study(
    cases: int, correlation: float, executor: Executor, disturbed: bool = False
) -> dict[str, Any]:
    """Return coverage by term and of all, with one kind of noise."""
    jobs = [(name, seed) for seed in range(cases) for name in TERMS]
    each = replicates(partial(one_case, disturbed=disturbed), jobs, correlation, executor)
    return {
        "cases": len(each),
        "driver": Share.among(case["driver"] for case in each).as_dict(),
        "formula": Share.among(bool(case["parameters"]) for case in each).as_dict(),
        **covered(each, "term", TERMS),
    }


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--cases", type=int, default=12, help="cases of each term")
    parser.add_argument("--quick", action="store_true", help="one case of each term")
    arguments = parser.parse_args()
    cases = 1 if arguments.quick else arguments.cases
    result = under_both_noises(study, cases)
    result["disturbed"] = under_both_noises(partial(study, disturbed=True), cases)
    result |= provenance.made(SEED, arguments.quick)
    print(tables.term_coverage(result))
    provenance.write(arguments.json, result)


if __name__ == "__main__":
    main()
