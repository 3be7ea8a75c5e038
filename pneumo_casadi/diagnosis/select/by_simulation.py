"""What simulations alone show: an effect where the balances leave no gap, weak ones beside a play.

Bristles hold a piston where Coulomb friction lets it break away: within half a second a simulation
is far off, and the balances, of the motion that was measured, show next to nothing.
"""

from collections.abc import Mapping, Sequence

from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.starting_values import values_of
from pneumo_casadi.diagnosis.select.acceptance import corrects_map
from pneumo_casadi.diagnosis.select.complete import Completed, find_acting
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names, Start
from pneumo_casadi.diagnosis.select.forms import other_forms_of, stand_for_cause
from pneumo_casadi.diagnosis.select.hidden_motion import TRIED, beside, closes_more
from pneumo_casadi.diagnosis.select.refined_trials import refine_all


def find_in_simulation(
    ledger: FitLedger, nominal: FittedModel, known: Names, levels: BalanceLevels
) -> Names | None:
    """Return a model with the effect that explains a gap which simulations alone show, if any.

    The balances show no gap, or none is left beside the effects `known`, weak ones, which leave
    most of what simulations show. Every effect is simulated as fitted alone. The few that close
    enough of the gap are refined by output error, with the other forms of the best one's cause, of
    which the balances tell nothing. The best of these must leave half of the gap at most, and
    surely close what a further effect must of what the known ones leave. What corrects a flow map
    is left out: a refinement holds the map.
    """
    criteria, simulations = levels.criteria, ledger.simulations
    base, before = (ledger.fits[known], ledger.effects(known)) if known else (nominal, ())
    if not simulations.alone_show_gap(base, before, levels):
        return None
    share = simulations.share(nominal, base, before) if known else 1.0
    if share <= criteria.unexplained:
        return None
    alone = {key: fit for key, fit in ledger.extensions(()).items() if key[0] not in known}
    left = _left_alone(ledger, nominal, alone)
    if left and min(left.values()) <= criteria.closed:
        (best,) = min(left, key=left.__getitem__)
        others = other_forms_of(ledger, best)
        forms: dict[Names, Start] = {(name,): Start(nominal.values) for name in others}
        ledger.fit_all(forms)
        left |= _left_alone(ledger, nominal, {k: ledger.fits[k] for k in forms if k in ledger.fits})
    near = sorted((names for names in left if left[names] <= criteria.closed), key=left.__getitem__)
    starts = _beside(ledger, known, [names[0] for names in near[:TRIED]])
    refine_all(ledger, nominal, starts)
    refined = {names: ledger.trials[names][1] for names in starts}
    chosen = min(refined, key=refined.__getitem__, default=None)
    if chosen is None or refined[chosen] > criteria.unexplained:
        return None
    if not closes_more(refined[chosen], share, criteria):
        return None
    closed = simulations.closure(base, ledger.trials[chosen][0], ledger.effects(chosen), before)
    if closed.lower < 1.0 - criteria.closed:
        return None
    for name in chosen:
        stand_for_cause(ledger, name)
    ledger.take(chosen)
    ledger.by_simulation = True
    return chosen


def _beside(ledger: FitLedger, known: Names, names: Sequence[str]) -> dict[Names, FittedModel]:
    """Return the balances' fits of some effects beside those known."""
    alone = {name: ledger.fits[name,].values for name in names}
    if known:
        values = ledger.fits[known].values
        starts = {
            ledger.key((*known, name)): Start({**values, **values_of(name, alone[name])})
            for name in names
        }
        ledger.fit_all(starts)
    keys = [ledger.key((*known, name)) for name in names]
    return {key: ledger.fits[key] for key in keys if key in ledger.fits}


def _left_alone(
    ledger: FitLedger, nominal: FittedModel, fits: Mapping[Names, FittedModel]
) -> dict[Names, float]:
    """Return the share of the simulated gap that each effect leaves, as fitted alone."""
    fits = {names: fit for names, fit in fits.items() if not corrects_map(ledger.effects(names))}
    ledger.begin_simulations(fits)
    return {
        names: ledger.simulations.share(nominal, fit, ledger.effects(names))
        for names, fit in fits.items()
    }


def complete_by_simulation(
    ledger: FitLedger, nominal: FittedModel, final: Names, levels: BalanceLevels
) -> Completed:
    """Return a final model that hides the motion with weak effects, if these close the gap.

    Where several weak effects act, none alone closes enough of the gap to be told from chance. What
    the balances ask for all together is refined by output error: it is taken if simulations then
    are explained. The balances are no judge of each of them, so none is named.
    """
    criteria, left = levels.criteria, ledger.gap_left[final]
    if left < criteria.simulated:
        return Completed(final, final)
    acting = find_acting(ledger, nominal, final, levels, set(final).issubset)
    if not set(final) < set(acting):
        return Completed(final, final)
    added = tuple(name for name in acting if name not in final)
    refine_all(ledger, nominal, {acting: beside(ledger, nominal, final, added)})
    if ledger.trials[acting][1] > min(criteria.simulated, criteria.closed * left):
        return Completed(final, final)
    ledger.take(acting)
    return Completed(acting, final)
