"""Effects that hide the motion, and effects beside them: only simulations show their gain.

While a play is crossed, no sensor shows the motion: the best fit to the balances may be no better
on held-out records until it is refined by output error.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels, residual_rms
from pneumo_casadi.diagnosis.prepare.criteria import Criteria
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.starting_values import values_of
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names
from pneumo_casadi.diagnosis.select.propose import fit_extensions
from pneumo_casadi.diagnosis.select.refined_trials import (
    begin_refinement,
    refine_again,
    refine_all,
)
from pneumo_casadi.estimation.equation_error.balance_functions import any_sensor_effect
from pneumo_casadi.estimation.equation_error.smoothed_motion import BANDWIDTH
from pneumo_casadi.model.effect import Effect

#: Number of the best pairs, and of the best effects alone, that are tried beside such an effect.
TRIED = 3
#: Iterations of output error for each of them; the best goes on to its end.
TRIAL_ITERATIONS = 12


def motion_is_hidden(effects: Sequence[Effect], fitted: FittedModel) -> bool:
    """Tell whether the sensors cannot show the motion of a model with these effects, as fitted."""
    return any(hides(effect, fitted.values) for effect in effects)


def hides(effect: Effect, values: Mapping[str, float]) -> bool:
    """Tell whether an effect hides the motion at values by full names, else at its usual ones."""
    short = {
        item.name: values.get(f"{effect.name}.{item.name}", item.value)
        for item in effect.parameters
    }
    return effect.hides(short, BANDWIDTH)


def find_hiding_extension(
    ledger: FitLedger,
    nominal: FittedModel,
    current: FittedModel,
    known: Names,
    levels: BalanceLevels,
) -> Names | None:
    """Return a model with one more effect, which hides the motion, if simulations gain by it.

    Parameters
    ----------
    current : FittedModel
        The best model so far, with the effects `known`.
    """
    fits = ledger.extensions(known)
    best = min(fits, key=lambda key: fits[key].cost, default=None)
    if best is None or not np.any(levels.exceeded(residual_rms(current), levels.criteria.clean)):
        return None
    criteria, effects, before = levels.criteria, ledger.effects(best), ledger.effects(known)
    if (
        fits[best].cost > current.cost - criteria.form_gain
        or not motion_is_hidden(effects, fits[best])
        or any_sensor_effect(before)
    ):
        return None
    refine_all(ledger, nominal, {best: fits[best]})
    share = ledger.simulations.share(nominal, current, before)
    if not closes_more(ledger.trials[best][1], share, criteria):
        return None
    ledger.take(best)
    return best


def closes_in_simulation(ledger: FitLedger, nominal: FittedModel, names: Names) -> bool:
    """Tell whether a model that hides the motion closes the gap once it is simulated."""
    if not motion_is_hidden(ledger.effects(names), ledger.fits[names]):
        return False
    _begin_what_follows(ledger, names)
    refine_all(ledger, nominal, {names: ledger.fits[names]})
    if ledger.trials[names][1] < ledger.study.criteria.simulated:
        ledger.take(names)
        return True
    return False


def _begin_what_follows(ledger: FitLedger, names: Names) -> None:
    """Begin to refine a model and what `extend_by_simulation` then asks for, side by side."""
    alone = _hiding(ledger, names)
    models = {key: ledger.fits[key] for key in (names, alone) if key in ledger.fits}
    for key, fitted in models.items():
        begin_refinement(ledger, key, fitted)
    if ledger.executor is not None:
        ledger.begin_simulations(models)


def extend_by_simulation(
    ledger: FitLedger,
    nominal: FittedModel,
    path: tuple[Names, ...],
    levels: BalanceLevels,
    max_effects: int,
) -> tuple[Names, ...]:
    """Go on by simulations where the motion is hidden, and return the path taken.

    If the effects that the balances have added leave much of the simulated gap, the search starts
    again from the effect that hides the motion; its result is taken if it leaves no more.
    """
    if not path or not motion_is_hidden(ledger.effects(path[-1]), ledger.fits[path[-1]]):
        return path
    refine_all(ledger, nominal, {path[-1]: ledger.fits[path[-1]]})
    first = path[-1] if len(path) == 1 else _without_needless(ledger, nominal, path[-1])
    if ledger.trials[first][1] >= ledger.study.criteria.simulated:
        alone = _hiding(ledger, first)
        first = alone if alone in ledger.fits else first
    grown = _grown(ledger, nominal, first, levels, max_effects)
    left = ledger.trials[grown[-1]][1]
    # One that could not be refined leaves an infinite share.
    if grown[-1] == path[-1] or not left < 1.0 or left > ledger.trials[path[-1]][1]:
        _take_refined(ledger, nominal, path[-1])
        return path
    ledger.take(grown[-1])
    return (*(names for names in path if set(names) < set(first)), *grown)


def _grown(
    ledger: FitLedger, nominal: FittedModel, first: Names, levels: BalanceLevels, most: int
) -> tuple[Names, ...]:
    """Return a model and those that it grows to, one effect more each, as simulations ask for."""
    grown = [first]
    while len(grown[-1]) < most:
        more = _extended(ledger, nominal, grown[-1], levels)
        if more is None:
            break
        grown.append(more)
    return tuple(grown)


def _take_refined(ledger: FitLedger, nominal: FittedModel, names: Names) -> None:
    """Choose a model as refined, unless the fit to the balances leaves less of the gap."""
    effects = ledger.effects(names)
    if ledger.trials[names][1] < ledger.simulations.share(nominal, ledger.fits[names], effects):
        ledger.take(names)


def _extended(
    ledger: FitLedger, nominal: FittedModel, known: Names, levels: BalanceLevels
) -> Names | None:
    """Return a model with one more effect that simulations show to be better, or None."""
    refine_all(ledger, nominal, {known: ledger.fits[known]})
    fitted, share = ledger.trials[known]
    criteria = ledger.study.criteria
    if share < (criteria.matters if len(known) == 1 else criteria.unexplained):
        return None
    if not ledger.simulations.leave_gap(fitted, ledger.effects(known)):
        return None
    # What a delay of the sensor hides from an effect alone the balances show beside it.
    fit_extensions(ledger, nominal, ledger.fits[known], known, levels)
    keys = {name: ledger.key((*known, name)) for name in _candidates(ledger, known)}
    starts = {
        key: beside(ledger, nominal, known, (name,))
        for name, key in keys.items()
        if key not in ledger.failures  # refused with a reason
    }
    refine_all(ledger, nominal, starts, TRIAL_ITERATIONS)
    shares = {key: ledger.trials[key][1] for key in starts}
    # Leaving more than the model that it contains, a model has begun too far off.
    far = {
        keys[name]: _with_starting_values(ledger, known, keys[name])
        for name in keys
        if _gains(ledger, known, (name,)) and shares.get(keys[name], 0.0) > share + criteria.matters
    }
    refine_again(ledger, nominal, far, TRIAL_ITERATIONS)
    best = min(starts, key=lambda key: ledger.trials[key][1], default=None)
    if best is None or ledger.trials[best][1] > criteria.closed * share:
        return None
    refine_again(ledger, nominal, {best: ledger.trials[best][0]})
    left = ledger.trials[best][1]
    if left > 1.0 or not closes_more(left, share, criteria):
        return None
    if not _is_needed(ledger, nominal, known, best):
        return None
    ledger.fits.setdefault(best, ledger.trials[best][0])
    return best


def _is_needed(ledger: FitLedger, nominal: FittedModel, known: Names, names: Names) -> bool:
    """Tell whether a model needs the effects that it has beside the known ones.

    While sensors hide the motion, the cost is rough, and a fit may end in a local minimum out of
    which another effect has led by chance. So the smaller model begins again where the larger one
    has ended, and keeps what it gains by that.
    """
    larger, share = ledger.trials[names]
    added = tuple(f"{name}." for name in names if name not in known)
    values = {n: v for n, v in larger.values.items() if not n.startswith(added)}
    refine_again(ledger, nominal, {known: replace(larger, effects=known, values=values)})
    return closes_more(share, ledger.trials[known][1], ledger.study.criteria)


def closes_more(left: float, before: float, criteria: Criteria) -> bool:
    """Return whether what a model leaves is as much less as with a further effect it must be."""
    return left <= min(criteria.closed * before, before - criteria.matters)


def _without_needless(ledger: FitLedger, nominal: FittedModel, names: Names) -> Names:
    """Return the effect that hides the motion alone if the others were added in vain."""
    alone = _hiding(ledger, names)
    if alone == names or alone not in ledger.fits:
        return names
    refine_all(ledger, nominal, {alone: ledger.fits[alone]})
    return names if _is_needed(ledger, nominal, alone, names) else alone


def _hiding(ledger: FitLedger, names: Names) -> Names:
    """Return those effects of a model that hide the motion."""
    fitted = ledger.fits[names]
    return tuple(effect.name for effect in ledger.effects(names) if hides(effect, fitted.values))


def _candidates(ledger: FitLedger, known: Names) -> Sequence[str]:
    """Return effects to try where the motion is hidden: the best fits, and `confused_with`.

    The latter are tried whatever their fit, because the fit uses the measured motion: while that is
    distorted, the estimate of an effect that acts in this motion may go to zero.
    """

    def best(fits: dict[Names, FittedModel]) -> list[Names]:
        return sorted(fits, key=lambda key: fits[key].cost)[:TRIED]

    alone = {key: f for key, f in ledger.extensions(()).items() if not set(key) & set(known)}
    names = {name for key in (*best(ledger.extensions(known)), *best(alone)) for name in key}
    for effect in ledger.effects(known):
        if effect.hides_motion:
            names |= {n for n in effect.confused_with if n in ledger.catalogue}
    names -= {*known, *ledger.left_out}
    made = {name: ledger.catalogue[name]() for name in ledger.key(names)}
    # A refinement fixes the flow map, so that effects of the metered valve shape are left out. A
    # second one that hides the motion is tried only if it lowers the cost of the fit as well: the
    # first one may already describe the same error.
    return [
        name
        for name, effect in made.items()
        if not effect.metered and (_gains(ledger, known, (name,)) or not effect.hides_motion)
    ]


def _gains(ledger: FitLedger, known: Names, added: Sequence[str]) -> bool:
    """Tell whether more effects were fitted beside the known ones, and gained something."""
    fitted = ledger.fits.get(ledger.key((*known, *added)))
    return (
        fitted is not None
        and fitted.cost < ledger.fits[known].cost - ledger.study.criteria.form_gain
    )


def beside(
    ledger: FitLedger, nominal: FittedModel, known: Names, added: Sequence[str]
) -> FittedModel:
    """Return where output error begins with further effects beside a model that it has refined.

    The refined model goes on with the effects as the balances have them where they gained, else at
    their start. The balances' fit of all of them begins farther off: they take a play for half of
    what output error makes of it, and twelve iterations did not bring it back. It is where to begin
    only if its smaller model leaves less of the gap than the refined one.
    """
    _, share = ledger.trials[known]
    key, effects = ledger.key((*known, *added)), ledger.effects(known)
    start = _with_starting_values(ledger, known, key)
    if not _gains(ledger, known, added):
        return start
    if ledger.simulations.share(nominal, ledger.fits[known], effects) < share:
        return ledger.fits[key]
    values = dict(start.values)
    for name in added:
        values |= values_of(name, ledger.fits[key].values)
    return replace(start, values=values)


def _with_starting_values(ledger: FitLedger, known: Names, names: Names) -> FittedModel:
    """Return a refined model with further effects at their starting values."""
    base, _ = ledger.trials[known]
    axis = ledger.study.axis.with_effects(*ledger.effects(names)).at_starting_values()
    values = axis.with_parameters(dict(base.values)).parameters.as_dict()
    return replace(base, effects=names, values=values)
