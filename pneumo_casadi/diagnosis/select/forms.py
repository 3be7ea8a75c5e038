"""Forms of one cause: the one that fits best alone stands for the family in all further models."""

from collections.abc import Collection, Iterable, Mapping

import numpy as np

from pneumo_casadi.diagnosis.metrics.residual_size import (
    BalanceLevels,
    gain_on_all_records,
    gaps,
    leaves_too_much,
    residual_rms,
    share_left,
)
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.screen.background import background
from pneumo_casadi.diagnosis.screen.screen import ScreenResult
from pneumo_casadi.diagnosis.select.fit_ledger import Catalogue, FitLedger, Names, Start

#: Share of the squared residuals that the screen must promise of a further form. Of four hoses that
#: were such a form it promised a third and more; a fit of it takes two or three seconds. Beside
#: other effects a further form must close three tenths of what is left, far more.
PROMISE = 0.01
#: Share of the gain of the best effect alone from which on a cause leads: all its forms are tried.
NEAR_BEST = 0.5


def cause_of(name: str, catalogue: Catalogue) -> str:
    """Return the cause that an effect is a form of; a name that is not there is its own cause."""
    factory = catalogue.get(name)
    return name if factory is None else str(getattr(factory, "cause", "") or name)


def causes_of(names: Iterable[str], catalogue: Catalogue) -> Names:
    """Return the causes of some effects, in their order, each once."""
    return tuple(dict.fromkeys(cause_of(name, catalogue) for name in names))


def forms_to_fit(ledger: FitLedger, screened: Mapping[str, ScreenResult]) -> list[str]:
    """Return the effects to fit alone; of further forms of a cause only what promises something.

    The usual forms are all fitted, and those whose start is scanned, unless they contain another
    one: the screen sees one resonance. Those with stairs take long, and wait for what the others
    leave; see `fit_forms_of_leading_causes`.
    """
    return [name for name in screened if _fitted_at_once(ledger, name, screened)]


def _fitted_at_once(ledger: FitLedger, name: str, screened: Mapping[str, ScreenResult]) -> bool:
    if cause_of(name, ledger.catalogue) == name:
        return True
    return not _has_stairs(ledger, name) and _promises(ledger, name, screened)


def _promises(ledger: FitLedger, name: str, screened: Mapping[str, ScreenResult]) -> bool:
    """Return whether an effect may take enough of the residuals away, or the screen cannot tell.

    A form that contains another one must promise as much more than that.
    """
    result, made = screened.get(name), ledger.catalogue[name]
    if result is None or not result.felt:
        return True
    contained = screened.get(_contained(ledger, name))
    if contained is not None:
        return result.explained >= contained.explained + PROMISE
    return bool(getattr(made, "scanned", {})) or result.explained >= PROMISE


def _contained(ledger: FitLedger, name: str) -> str:
    return str(getattr(ledger.catalogue[name], "generalises", ""))


def _has_stairs(ledger: FitLedger, name: str) -> bool:
    return bool(getattr(ledger.catalogue[name], "staircase", ()))


def begin_waiting_forms(
    ledger: FitLedger, nominal: FittedModel, screened: Mapping[str, ScreenResult]
) -> None:
    """Begin to fit forms that wait where the screen promises much of the usual form of their cause.

    They take as long as all others together: `fit_forms_of_leading_causes`, which decides by what
    the others leave, finds them done.
    """
    least = NEAR_BEST * max((result.gain for result in screened.values()), default=0.0)
    for name, cause in _waiting(ledger).items():
        if cause in screened and cause != name and screened[cause].gain > least:
            ledger.begin_fit((name,), Start(nominal.values))


def fit_forms_of_leading_causes(
    ledger: FitLedger,
    nominal: FittedModel,
    screened: Mapping[str, ScreenResult],
    levels: BalanceLevels,
) -> None:
    """Fit the forms not tried so far, alone, where the usual form of their cause leaves a gap.

    It must close about as much as the best effect alone: before a further cause is looked for, the
    leading ones are tried in all their forms.
    """
    gains = {key[0]: nominal.cost - fit.cost for key, fit in ledger.extensions(()).items()}
    least = NEAR_BEST * max(gains.values(), default=0.0)
    leading = {
        name
        for name, gain in gains.items()
        if gain > least and np.any(gaps(residual_rms(ledger.fits[name,]), levels))
    }
    untried = [
        name
        for name in ledger.catalogue
        if cause_of(name, ledger.catalogue) in leading
        and name not in gains
        and (name,) not in ledger.failures
    ]
    stairs: dict[Names, Start] = {
        (name,): Start(nominal.values) for name in untried if _has_stairs(ledger, name)
    }
    others = [name for name in untried if (name,) not in stairs]
    ledger.fit_all(stairs)  # those of one cause are rivals, and no others cut them short
    ledger.fit_all({(name,): start_alone(nominal, screened.get(name)) for name in others})


def _waiting(ledger: FitLedger) -> dict[str, str]:
    """Return the effects with stairs, each with its cause."""
    return {
        name: cause_of(name, ledger.catalogue)
        for name in ledger.catalogue
        if _has_stairs(ledger, name)
    }


def keep_best_forms(
    ledger: FitLedger, nominal: FittedModel
) -> Mapping[str, Mapping[str, FittedModel]]:
    """Keep the form of every cause that fits all records best; return the fits of all, by cause.

    Only causes with several forms are returned. The others are out of the screen and of all
    further models: two forms of one cause in a model would share its gain.
    """
    forms: dict[str, list[str]] = {}
    for name in ledger.catalogue:
        forms.setdefault(cause_of(name, ledger.catalogue), []).append(name)
    fits: dict[str, Mapping[str, FittedModel]] = {}
    for cause, names in forms.items():
        fitted = {name: ledger.fits[name,] for name in names if (name,) in ledger.fits}
        if len(names) == 1 or not fitted:
            continue
        best = max(
            fitted,
            key=lambda name: gain_on_all_records(nominal, fitted[name]) - _price(ledger, (name,)),
        )
        fits[cause] = fitted
        stand_for_cause(ledger, best)
    return fits


def fit_remaining_forms(
    ledger: FitLedger,
    nominal: FittedModel,
    screened: Mapping[str, ScreenResult],
    tried: Collection[str],
) -> Mapping[str, Mapping[str, FittedModel]]:
    """Fit the forms not tried so far alone; return the fits by cause, as `keep_best_forms` does.

    Where no effect is accepted, before the gap is called unknown. The screen feels no parameter
    that acts only beside others, as the progression of a spring does; such a form promises no more
    than the one it contains. Those with stairs wait for the usual form all the same.
    """
    waiting = _waiting(ledger)
    rest = [name for name in ledger.catalogue if name not in tried and name not in waiting]
    ledger.left_out -= set(rest)
    ledger.fit_all({(name,): start_alone(nominal, screened.get(name)) for name in rest})
    return keep_best_forms(ledger, nominal) if rest else {}


def start_alone(nominal: FittedModel, screened: ScreenResult | None) -> Start:
    """Return where the fit of an effect alone begins: at every sign of its shape."""
    if screened is None:
        return Start(nominal.values)
    return Start(nominal.values, screened.starts, None if screened.felt else nominal.cost)


def _price(ledger: FitLedger, names: Iterable[str]) -> float:
    """Return the log-likelihood by which forms must be better than the usual ones of their causes.

    The usual form, named as its cause, has no more parameters than others; one that contains
    another form has more than that one.
    """
    further = 0
    for form in names:
        while form in ledger.catalogue and cause_of(form, ledger.catalogue) != form:
            further += 1
            form = _contained(ledger, form)
    return further * ledger.study.criteria.form_gain


def other_forms_of(ledger: FitLedger, name: str) -> list[str]:
    """Return the forms of an effect's cause that were left out, but for those with stairs."""
    cause = cause_of(name, ledger.catalogue)
    return [
        form
        for form in sorted(ledger.left_out)
        if cause_of(form, ledger.catalogue) == cause and not _has_stairs(ledger, form)
    ]


def stand_for_cause(ledger: FitLedger, form: str) -> None:
    """Offer a form of a cause, and no other one of it to any further model."""
    cause = cause_of(form, ledger.catalogue)
    for name in ledger.catalogue:
        if name != form and cause_of(name, ledger.catalogue) == cause:
            ledger.leave_out(name)
    ledger.left_out.discard(form)


def with_other_form(
    ledger: FitLedger, nominal: FittedModel, known: Names, levels: BalanceLevels
) -> Names:
    """Return a model with another form of some cause, where a visible gap is left.

    A form is chosen by how it fits alone; beside another effect that closes more, another form may
    be the right one. It takes the place of its cause's form if it fits all records better. Where
    too much is left, forms with stairs, which take long, are tried too, and a form of a cause that
    is not in the model may stand besides, if the screen promises something of it; it must close
    what a further effect must. Of several such models the one that fits all records best is taken.

    Parameters
    ----------
    ledger : FitLedger
        The fits.
    nominal : FittedModel
        The model without effects.
    known : tuple of str
        Effects of the model that leaves a gap.
    levels : BalanceLevels
        Noise and signal of the held-out records.
    """
    current, criteria = ledger.fits[known], levels.criteria
    if not np.any(levels.exceeded(residual_rms(current), criteria.visible)):
        return known
    too_much = leaves_too_much(nominal, current, levels)
    starts = {}
    for form in _forms_to_try(ledger, nominal, known, too_much):
        cause = cause_of(form, ledger.catalogue)
        others = [name for name in known if cause_of(name, ledger.catalogue) != cause]
        starts[ledger.key((*others, form))] = Start(current.values)
    ledger.fit_all(starts)
    most = criteria.closed * share_left(nominal, current, levels)
    gains = {
        key: gain_on_all_records(current, ledger.fits[key]) for key in starts if key in ledger.fits
    }
    better = [
        key
        for key, gain in gains.items()
        if gain >= max(criteria.form_gain, _price(ledger, key) - _price(ledger, known))
        and (len(key) == len(known) or share_left(nominal, ledger.fits[key], levels) <= most)
    ]
    best = max(better, key=lambda key: gains[key] - _price(ledger, key), default=known)
    for key in gains:  # another form of a cause is no rival of it
        if len(key) == len(known) and key != best:
            del ledger.fits[key]
    if best != known:
        for form in set(best) - set(known):
            stand_for_cause(ledger, form)
        if len(best) == len(known):  # of a model of one effect, that has been done
            ledger.fits.pop(known, None)
        ledger.refine(best)
    return best


def _forms_to_try(
    ledger: FitLedger, nominal: FittedModel, known: Names, too_much: bool
) -> list[str]:
    """Return other forms of causes that a model has, and where too much is left of further ones.

    Those with stairs take long: they are tried where too much is left, and are the first, so that
    no process waits at the end. Of a further cause the screen must promise something of the form,
    or of the usual one if the form has stairs: where these are small they are not felt.
    """
    present = causes_of(known, ledger.catalogue)
    ordered = sorted(ledger.left_out, key=lambda name: (not _has_stairs(ledger, name), name))
    own = [form for form in ordered if cause_of(form, ledger.catalogue) in present]
    if not too_much:
        return [form for form in own if not _has_stairs(ledger, form)]
    screened = {
        form: cause_of(form, ledger.catalogue) if _has_stairs(ledger, form) else form
        for form in ordered
        if form not in own
    }
    behind = background(ledger.study, nominal, ledger.fits[known], ledger.effects(known))
    wanted = {*screened.values(), *(_contained(ledger, form) for form in screened)}
    promised = ledger.screen(behind, wanted & set(ledger.directions))
    return [form for form in ordered if form in own or _promises(ledger, screened[form], promised)]
