"""One effect that stands for two: a shifted null moves an axis as several small leaks do."""

from itertools import combinations

import numpy as np

from pneumo_casadi.diagnosis.metrics.residual_size import residual_rms
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names, start_with

#: Number of effects, the best in place of one, that are tried in pairs there.
PAIRED = 3


def split_effects(ledger: FitLedger, final: Names, most: int) -> Names:
    """Return the final model, an effect replaced by two where these explain the records better.

    The search takes the effect that gains most; if that stands for two others, neither has anything
    left to gain. Replaced are effects of which one form is known, by pairs of those they are
    confused with. Effects with further forms stay: what an unknown form leaves, any pair would
    lower.

    Parameters
    ----------
    final : tuple of str
        Effects of the model that the search has found.
    most : int
        Largest number of effects in a model.

    Returns
    -------
    tuple of str
        The model to go on with; `final` where no pair is better by a size that matters.
    """
    best = final
    for name in final:
        (effect,) = ledger.effects((name,))
        if len(best) == most or not effect.one_form or name not in best:
            continue
        pairs = _fit_pairs_in_place(ledger, best, name)
        better = [(ledger.fits[key].cost, key) for key in pairs if _is_better(ledger, best, key)]
        best = min(better)[1] if better else best
    return best


def _fit_pairs_in_place(ledger: FitLedger, final: Names, name: str) -> list[Names]:
    """Fit the model with an effect replaced by each that is confused with it, the best in pairs."""
    rest = tuple(each for each in final if each != name)
    single = {
        ledger.key((*rest, other)): other
        for other in _confused(ledger, name)
        if other not in final and (other,) in ledger.fits
    }
    ledger.fit_all(
        {
            key: start_with(ledger.fits[final], other, ledger.fits[other,])
            for key, other in single.items()
        }
    )
    fitted = sorted((ledger.fits[key].cost, key) for key in single if key in ledger.fits)[:PAIRED]
    pairs = {}
    for (_, first), (_, second) in combinations(fitted, 2):
        start = start_with(ledger.fits[first], single[second], ledger.fits[second])
        pairs[ledger.key({*first, *second})] = start
    ledger.fit_all(pairs)
    return [key for key in pairs if key in ledger.fits]


def _confused(ledger: FitLedger, name: str) -> list[str]:
    """Return the effects that are confused with one, by what either says of itself."""
    (effect,) = ledger.effects((name,))
    causes = {effect.name, effect.cause}
    return [
        other
        for other in ledger.directions
        if other in effect.confused_with
        or causes.intersection(ledger.effects((other,))[0].confused_with)
    ]


def _is_better(ledger: FitLedger, final: Names, key: Names) -> bool:
    """Return whether a model fits clearly better, on held-out records by a size that matters."""
    criteria = ledger.study.criteria
    before, after = ledger.fits[final], ledger.fits[key]
    decrease = np.log(residual_rms(before) / residual_rms(after))
    return bool(
        after.cost < before.cost - criteria.form_gain
        and decrease.sum() > 0
        and decrease.max() > criteria.matters
    )
