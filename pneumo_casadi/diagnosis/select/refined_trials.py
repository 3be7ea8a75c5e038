"""Models refined by output error and simulated, each once; the ledger keeps them as trials."""

from collections.abc import Mapping, Sequence

import numpy as np

from pneumo_casadi.diagnosis.metrics.simulated_fit import Simulated, simulate_fit
from pneumo_casadi.diagnosis.prepare.fitted_model import FAULTS, FittedModel, require_credible
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.select.fit_ledger import Failed, FitLedger, Names
from pneumo_casadi.diagnosis.select.output_error_refinement import (
    MAX_ITERATIONS,
    refine_by_output_error,
)
from pneumo_casadi.model.effect import Effect


def refine_all(
    ledger: FitLedger,
    nominal: FittedModel,
    starts: Mapping[Names, FittedModel],
    iterations: int = MAX_ITERATIONS,
) -> None:
    """Refine models by output error and simulate them, those that were not tried already.

    `trials` of the ledger then holds each with the share of the simulated gap that it leaves,
    infinite where the refinement has failed.
    """
    for key, start in starts.items():
        begin_refinement(ledger, key, start, iterations)
    for key in [key for key in starts if key not in ledger.trials]:
        try:
            better, simulated = ledger.refinements.pop(key).result()
        except FAULTS as error:
            ledger.trials[key] = starts[key], np.inf
            if key not in ledger.fits:
                ledger.failures[key] = Failed(key, f"refined by output error: {error}")
            continue
        ledger.simulations.keep(better, simulated)
        share = ledger.simulations.share(nominal, better, ledger.effects(key))
        ledger.trials[key] = better, share


def begin_refinement(
    ledger: FitLedger, names: Names, start: FittedModel, iterations: int = MAX_ITERATIONS
) -> None:
    """Begin to refine a model by output error, once; who asks for it by `refine_all` waits."""
    if names not in ledger.trials and names not in ledger.refinements:
        effects = ledger.effects(names)
        ledger.refinements[names] = ledger.run(_refine_and_simulate, start, effects, iterations)


def refine_again(
    ledger: FitLedger, nominal: FittedModel, names: Names, start: FittedModel | None = None
) -> None:
    """Refine a model again, from where it ended or another start; what leaves less is kept."""
    before = ledger.trials.pop(names)
    refine_all(ledger, nominal, {names: start or before[0]})
    ledger.trials[names] = min(before, ledger.trials[names], key=lambda trial: trial[1])
    ledger.failures.pop(names, None)  # where only the second refinement failed


def _refine_and_simulate(
    study: Study, start: FittedModel, effects: Sequence[Effect], iterations: int
) -> tuple[FittedModel, Simulated]:
    better = refine_by_output_error(study, start, effects, iterations)
    require_credible(study, effects, better)
    return better, simulate_fit(study, better, effects)
