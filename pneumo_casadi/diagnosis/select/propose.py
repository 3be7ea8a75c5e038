"""The models that a round of the selection fits: what may well be there besides."""

from collections.abc import Mapping, Sequence

import numpy as np

from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels, residual_rms
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.starting_values import values_of
from pneumo_casadi.diagnosis.screen.background import background
from pneumo_casadi.diagnosis.screen.screen import ScreenResult
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names, Start
from pneumo_casadi.diagnosis.select.forms import forms_to_fit, start_alone

#: Effects refitted in later rounds, in the order of the screen. The first round refits all: a
#: linearisation at the nominal fit does not predict the gain of a large effect.
LATER_ROUNDS = 5
#: Effects that are refitted for each balance that is still open: those that alone close most of it.
#: The most promising of all may act in balances that are at their floor already.
OF_EACH = 2


def fit_extensions(
    ledger: FitLedger,
    nominal: FittedModel,
    current: FittedModel,
    known: Names,
    levels: BalanceLevels,
) -> None:
    """Fit the additions to a model that promise most, of all and in each balance still open.

    An addition that promises less than another form of an effect must gain is left alone.
    """
    behind = background(ledger.study, nominal, current, ledger.effects(known))
    screened = ledger.over(behind, known)
    least = ledger.study.criteria.form_gain
    promising = [name for name, result in screened.items() if result.gain > least]
    still_open = _open_balances(current, levels)
    others = (
        *_for_open_balances(ledger, nominal, still_open, levels),
        *_promising_in(screened, still_open, least),
    )
    chosen = [name for name in (*promising[:LATER_ROUNDS], *others) if name in screened]
    ledger.fit_all(
        {
            ledger.key((*known, name)): Start(
                current.values, trials=where_to_begin(ledger, screened[name])
            )
            for name in dict.fromkeys(chosen)
        }
    )


def _open_balances(current: FittedModel, levels: BalanceLevels) -> list[int]:
    """Return the balances in which a model leaves more than a coarse flow map may."""
    visible = levels.exceeded(residual_rms(current), levels.criteria.visible)
    return [int(row) for row in np.flatnonzero(visible)]


def _for_open_balances(
    ledger: FitLedger, nominal: FittedModel, still_open: Sequence[int], levels: BalanceLevels
) -> list[str]:
    """Return effects that alone lower most, by a size that matters, what is left in a balance."""
    criteria, before = levels.criteria, residual_rms(nominal)
    drops = {
        key[0]: np.log(before / residual_rms(fit)) for key, fit in ledger.extensions(()).items()
    }
    chosen: list[str] = []
    for row in still_open:
        matter = [name for name, drop in drops.items() if drop[row] >= criteria.matters]
        chosen += sorted(matter, key=lambda name: -drops[name][row])[:OF_EACH]
    return chosen


def _promising_in(
    screened: Mapping[str, ScreenResult], still_open: Sequence[int], least: float
) -> list[str]:
    """Return the effect that promises most in each balance that is still open.

    Of all balances together one that is open may promise little beside another.
    """
    chosen = []
    for row in still_open if screened else ():
        best = max(screened.values(), key=lambda result: float(result.by_balance[row]))
        if best.by_balance[row] > least:
            chosen.append(best.name)
    return chosen


def fit_alone(
    ledger: FitLedger, nominal: FittedModel, screened: Mapping[str, ScreenResult]
) -> None:
    """Fit a model with each effect alone, from every sign of its shape."""
    ledger.fit_all(
        {(name,): start_alone(nominal, screened[name]) for name in forms_to_fit(ledger, screened)}
    )


def where_to_begin(ledger: FitLedger, screened: ScreenResult) -> list[Mapping[str, float]]:
    """Return values of an effect from which a fit beside others may begin.

    Those that the screen promises most of, and those that it had alone: where others have taken
    over what it stood for it is mostly small, but what small ones do may not be felt.
    """
    alone = ledger.fits.get((screened.name,))
    at_end = () if alone is None else (values_of(screened.name, alone.values),)
    return [screened.sizes, *screened.starts, *at_end]
