"""Models refined by output error and simulated, each once; the ledger keeps them as trials."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Future

import numpy as np

from pneumo_casadi.diagnosis.metrics.simulated_fit import Simulated, simulate_fit
from pneumo_casadi.diagnosis.prepare.credible import require_credible
from pneumo_casadi.diagnosis.prepare.fitted_model import FAULTS, FittedModel
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
    jobs = {
        key: ledger.begun_refinements.take(key, (start, iterations))
        or _begin(ledger, key, start, iterations)
        for key, start in starts.items()
        if key not in ledger.trials
    }
    for key, job in jobs.items():
        try:
            better, simulated = job.result()
        except FAULTS as error:
            ledger.trials[key] = starts[key], np.inf
            if key not in ledger.fits:
                ledger.failures[key] = Failed(key, f"refined by output error: {error}")
            continue
        ledger.simulations.keep(better, simulated)
        share = ledger.simulations.share(nominal, better, ledger.effects(key))
        ledger.trials[key] = better, share


def begin_refinement(ledger: FitLedger, names: Names, start: FittedModel) -> None:
    """Begin to refine a model for which `refine_all` may be asked next, if there is an executor."""
    if ledger.executor is not None and names not in ledger.trials:
        job = _begin(ledger, names, start, MAX_ITERATIONS)
        ledger.begun_refinements.add(names, (start, MAX_ITERATIONS), job)


def _begin(
    ledger: FitLedger, names: Names, start: FittedModel, iterations: int
) -> "Future[tuple[FittedModel, Simulated]]":
    return ledger.run(_refine_and_simulate, start, ledger.effects(names), iterations)


def refine_again(
    ledger: FitLedger,
    nominal: FittedModel,
    starts: Mapping[Names, FittedModel],
    iterations: int = MAX_ITERATIONS,
) -> None:
    """Refine models that were refined before from other starts; what leaves less is kept."""
    before = {key: ledger.trials.pop(key) for key in starts}
    refine_all(ledger, nominal, starts, iterations)
    for key, trial in before.items():
        ledger.trials[key] = min(trial, ledger.trials[key], key=lambda each: each[1])
        if ledger.trials[key][1] < np.inf:
            ledger.failures.pop(key, None)  # where only one of the refinements failed


def _refine_and_simulate(
    study: Study, start: FittedModel, effects: Sequence[Effect], iterations: int
) -> tuple[FittedModel, Simulated]:
    better = refine_by_output_error(study, start, effects, iterations)
    require_credible(study, effects, better.values)
    return better, simulate_fit(study, better, effects)
