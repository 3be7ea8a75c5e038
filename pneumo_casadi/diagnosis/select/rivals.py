"""Rivals of the effects of a final model: others that do nearly as well in their place."""

import numpy as np

from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names, Start, start_with
from pneumo_casadi.diagnosis.select.hidden_motion import motion_is_hidden


def fit_rivals(ledger: FitLedger, nominal: FittedModel, final: Names, named: Names) -> None:
    """Fit the final model with an effect replaced by each that did nearly as well when it came.

    A leak across the piston moves an axis almost as a shifted null of its valve does. The search
    goes on beside the better of the two; only a final model with the other one shows whether the
    data can tell them apart.

    Parameters
    ----------
    final : tuple of str
        Effects of the final model.
    named : tuple of str
        Those that are named; what stands for a weak one besides is not asked.
    """
    if motion_is_hidden(ledger.effects(final), ledger.fits[final]):
        return  # the balances do not tell
    starts: dict[Names, Start] = {}
    for name in named:
        for other, fitted in near_rivals(ledger, nominal, final, name).items():
            key = ledger.key({*final, other} - {name})
            starts[key] = start_with(ledger.fits[final], other, fitted)
    ledger.fit_all(starts)


def near_rivals(
    ledger: FitLedger, nominal: FittedModel, final: Names, name: str
) -> dict[str, FittedModel]:
    """Return the fits in which another effect gained nearly what one of the final model did.

    Both are compared beside the same effects, all of them of the final model; of several such
    comparisons the one beside most effects counts. Nearly is what leaves a model its least
    probability, `Criteria.alike`, by the share of the gain that it misses.
    """
    criteria = ledger.study.criteria
    least = 1 - np.log(1 / criteria.alike) / criteria.sharpness
    rivals: dict[str, FittedModel] = {}
    compared = {*final, *ledger.left_out}
    beside = [key for key in ledger.fits if name in key and set(key) <= set(final)]
    for key in sorted(beside, key=len, reverse=True):
        base = ledger.key(set(key) - {name})
        before = ledger.fits.get(base) if base else nominal
        if before is None:
            continue
        gain = before.cost - ledger.fits[key].cost
        for other_key, fitted in ledger.extensions(base).items():
            (other,) = set(other_key) - set(base)
            if other in compared:
                continue
            compared.add(other)
            if gain > 0 and before.cost - fitted.cost >= least * gain:
                rivals[other] = fitted
    return rivals
