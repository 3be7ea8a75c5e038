"""Forward selection of effects from the nominal model, with one backtracking pass."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from itertools import pairwise
from pathlib import Path

import numpy as np

from pneumo_casadi.diagnosis.metrics.residual_size import (
    BalanceLevels,
    balance_levels,
    gaps,
    leaves_too_much,
    residual_rms,
    shares_left,
)
from pneumo_casadi.diagnosis.prepare.fit_store import Store
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel, fit_model
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.prepare.usable_records import require_rows
from pneumo_casadi.diagnosis.screen.background import background
from pneumo_casadi.diagnosis.screen.screen import ScreenResult
from pneumo_casadi.diagnosis.select.acceptance import accepted, can_matter, only_corrects_map
from pneumo_casadi.diagnosis.select.by_simulation import complete_by_simulation, find_in_simulation
from pneumo_casadi.diagnosis.select.complete import Completed, complete
from pneumo_casadi.diagnosis.select.contributions import contributions
from pneumo_casadi.diagnosis.select.fit_ledger import Catalogue, FitLedger, Names
from pneumo_casadi.diagnosis.select.forms import (
    begin_waiting_forms,
    fit_forms_of_leading_causes,
    fit_remaining_forms,
    keep_best_forms,
    with_other_form,
)
from pneumo_casadi.diagnosis.select.hidden_motion import (
    closes_in_simulation,
    extend_by_simulation,
    find_hiding_extension,
    motion_is_hidden,
)
from pneumo_casadi.diagnosis.select.propose import fit_alone, fit_extensions
from pneumo_casadi.diagnosis.select.selection import Selection
from pneumo_casadi.runtime.progress import Progress, no_progress, progress_range

#: Effects that are selected one after another, by refits of all that may be next; weak ones besides
#: are left to `complete`.
MAX_SELECTED = 3
#: Effects that have acted in a balance once it has been searched: more are selected as long as half
#: of a gap is left where fewer have.
SEARCHED = 2
#: Largest number of effects that are selected, or in a model that is judged by simulation.
MAX_EFFECTS = 6


def select_effects(
    study: Study,
    catalogue: Catalogue,
    executor: Executor | None = None,
    progress: Progress | None = None,
    keep: Path | None = None,
) -> Selection:
    """Find the effects that close the held-out gap of a study.

    Parameters
    ----------
    keep : path, optional
        Folder of finished fits, see `Store`.
    """
    report = progress or no_progress
    store = None if keep is None else Store.of(keep, study)
    ledger = FitLedger(study, catalogue, executor, store)
    report("nominal model", 0.0)
    nominal = fit_model(study, ())
    require_rows(nominal.used_held_out, study.held_out[0].source)
    levels = balance_levels(study)
    report("screening the catalogue", 0.1)
    ledger.screen_all(nominal)
    first = ledger.over(background(study, nominal, nominal))
    path, forms = _search(ledger, nominal, first, levels, report)
    first = {name: result for name, result in first.items() if name not in ledger.left_out}
    shares: Mapping[str, float] = {}
    completed, simulated = None, False
    if path:
        report("what else acts", 0.85)
        completed = _completed(ledger, nominal, path[-1], levels)
        final = completed.acting
        fitted = ledger.output_error_fits.get(final, ledger.fits[final])
        ledger.begin_report(final, fitted)
        report("what each effect contributes", 0.9)
        simulated = ledger.simulations.surely_explained(
            nominal, fitted, ledger.effects(final), levels.criteria
        )
        if simulated or _may_be_named(ledger, nominal, final, levels):
            shares = contributions(ledger, nominal, final, completed.named, levels)
    ledger.begun_fits.cancel_all()
    ledger.begun_refinements.cancel_all()
    failures = tuple(ledger.failures.values())
    return Selection(
        nominal,
        {k: fitted for k, (fitted, left) in ledger.trials.items() if left < np.inf} | ledger.fits,
        failures,
        first,
        path,
        levels,
        ledger.output_error_fits,
        ledger.gap_left,
        {key: share for key, (_, share) in ledger.trials.items()},
        ledger.simulations,
        forms,
        shares,
        completed,
        ledger.offered,
        ledger.by_simulation,
        simulated,
    )


def _may_be_named(
    ledger: FitLedger, nominal: FittedModel, final: Names, levels: BalanceLevels
) -> bool:
    """Return whether the effects of a model that simulations do not prove right may be named."""
    known_by_simulation = final in ledger.gap_left
    return known_by_simulation or not leaves_too_much(
        nominal, ledger.fits[final], levels, clear=True
    )


def _search(
    ledger: FitLedger,
    nominal: FittedModel,
    screened: Mapping[str, ScreenResult],
    levels: BalanceLevels,
    report: Progress,
) -> tuple[tuple[Names, ...], Mapping[str, Mapping[str, FittedModel]]]:
    """Return the path taken, and by cause the fits of all its forms that were tried.

    Where no effect is accepted, all forms are, before a visible gap is called unknown.
    """
    report("refitting single effects", 0.3)
    begin_waiting_forms(ledger, nominal, screened)
    fit_alone(ledger, nominal, screened)
    fit_forms_of_leading_causes(ledger, nominal, screened, levels)
    tried = {name for names in (*ledger.fits, *ledger.failures) for name in names}
    forms = keep_best_forms(ledger, nominal)
    ledger.begin_report((), nominal)
    path = _forward(ledger, nominal, levels, report)
    if path or not np.any(levels.exceeded(residual_rms(nominal), levels.criteria.visible)):
        return path, forms
    report("trying all forms", 0.8)
    more = fit_remaining_forms(ledger, nominal, screened, tried)
    forms = {**forms, **{cause: {**forms.get(cause, {}), **more[cause]} for cause in more}}
    return _forward(ledger, nominal, levels, progress_range(report, 0.8, 0.85)), forms


def _forward(
    ledger: FitLedger, nominal: FittedModel, levels: BalanceLevels, report: Progress
) -> tuple[Names, ...]:
    path: list[Names] = []
    current = nominal
    for round_ in range(MAX_EFFECTS):
        known: Names = path[-1] if path else ()
        if path and not _needs_more(ledger, nominal, path, levels):
            break
        if round_:
            report(f"looking for effect {round_ + 1}", 0.4 + 0.07 * round_)
            fit_extensions(ledger, nominal, current, known, levels)
        options = [
            (fitted.cost, key)
            for key, fitted in ledger.extensions(known).items()
            if accepted(nominal, current, fitted, levels)
            and not _coarse(ledger, current, known, key, levels)
        ]
        if not options:
            more = find_hiding_extension(ledger, nominal, current, known, levels)
            if more is None and not path:
                more = find_in_simulation(ledger, nominal, known, levels)
            path += [] if more is None else [more]
            break
        best = min(options)[1]
        if round_ == 1:
            best = _backtrack(ledger, nominal, best, levels, known)
        path.append(best)
        ledger.refine(best)
        if closes_in_simulation(ledger, nominal, best) or not np.any(
            gaps(residual_rms(ledger.fits[best]), levels)
        ):
            break
        if round_ and motion_is_hidden(ledger.effects(best), ledger.fits[best]):
            break  # where the motion is hidden, the balances are not reliable
        current = ledger.fits[best]
    if path and not motion_is_hidden(ledger.effects(path[-1]), ledger.fits[path[-1]]):
        better = with_other_form(ledger, nominal, path[-1], levels)
        if better != path[-1]:
            path = [*(names for names in path if set(names) < set(better)), better]
    report("comparing simulations", 0.8)
    taken = extend_by_simulation(ledger, nominal, tuple(path), levels, MAX_EFFECTS)
    if taken and not set(taken) & set(ledger.trials) and len(taken[-1]) < MAX_EFFECTS:
        more = find_in_simulation(ledger, nominal, taken[-1], levels)
        taken = taken if more is None else (*taken, more)
    simulated = bool(taken) and (taken[-1] in ledger.trials or not ledger.study.shows_accelerations)
    if simulated and taken[-1] not in ledger.gap_left:
        final, effects = ledger.fits[taken[-1]], ledger.effects(taken[-1])
        ledger.begin_simulations({(): nominal, taken[-1]: final})
        ledger.gap_left[taken[-1]] = ledger.simulations.share(nominal, final, effects)
    return taken


def _completed(
    ledger: FitLedger, nominal: FittedModel, final: Names, levels: BalanceLevels
) -> Completed:
    """Return the final model completed, unless balances tell little or the cause is unknown."""
    fitted = ledger.fits[final]
    if not ledger.study.shows_accelerations:
        return Completed(final, final)
    if final in ledger.trials:
        return complete_by_simulation(ledger, nominal, final, levels)
    hidden = motion_is_hidden(ledger.effects(final), fitted)
    if hidden or leaves_too_much(nominal, fitted, levels):
        return Completed(final, final)
    return complete(ledger, nominal, final, levels)


def _needs_more(
    ledger: FitLedger, nominal: FittedModel, path: Sequence[Names], levels: BalanceLevels
) -> bool:
    """Return whether a further effect is to be selected beside those accepted."""
    known, current = path[-1], ledger.fits[path[-1]]
    if len(known) >= MAX_SELECTED:
        fits = [nominal, *(ledger.fits[names] for names in path)]
        worst = int(np.argmax(shares_left(nominal, current, levels)))
        searched = acting_effects(fits, worst, levels.criteria.matters) >= SEARCHED
        return leaves_too_much(nominal, current, levels) and not searched
    return can_matter(nominal, current, levels)


def acting_effects(fits: Sequence[FittedModel], balance: int, matters: float) -> int:
    """Return how many effects have lowered the residual of a balance, one model after another."""
    return sum(
        len(after.effects) - len(before.effects)
        for before, after in pairwise(fits)
        if np.log(residual_rms(before) / residual_rms(after))[balance] >= matters
    )


def _coarse(
    ledger: FitLedger, current: FittedModel, known: Names, names: Names, levels: BalanceLevels
) -> bool:
    added = ledger.effects(name for name in names if name not in known)
    return only_corrects_map(added, current, levels, beside=bool(known))


def _backtrack(
    ledger: FitLedger, nominal: FittedModel, pair: Names, levels: BalanceLevels, known: Names
) -> Names:
    """Search a better partner for each effect of a pair: the first choice may replace two."""
    single = ledger.fits[known]
    for name in pair:
        alone = ledger.fits.get((name,))
        if alone is not None and alone is not single:
            fit_extensions(ledger, nominal, alone, (name,), levels)
    options = [
        (fitted.cost, key)
        for key, fitted in ledger.fits.items()
        if len(key) == 2
        and accepted(nominal, single, fitted, levels)
        and not _coarse(ledger, single, known, key, levels)
    ]
    return min(options)[1]
