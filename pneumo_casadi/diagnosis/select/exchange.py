"""One effect for another: the search keeps what gained most when it came, not what fits best."""

import numpy as np

from pneumo_casadi.diagnosis.metrics.residual_size import residual_rms
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names
from pneumo_casadi.diagnosis.select.hidden_motion import motion_is_hidden
from pneumo_casadi.diagnosis.select.rivals import fit_rivals


def exchange_effects(ledger: FitLedger, nominal: FittedModel, final: Names) -> Names:
    """Return the final model, effects replaced by others that explain the records better.

    Each effect was chosen beside those before it. Beside all others of the final model a rival may
    do better: a hose, which gained hardly more than the valve's dynamics while a shifted null was
    missing.

    Parameters
    ----------
    final : tuple of str
        Effects of the model that the search has found.

    Returns
    -------
    tuple of str
        A model of as many effects; `final` where no exchange is better by a size that matters.
    """
    while True:
        fit_rivals(ledger, nominal, final)
        better = [
            (fitted.cost, key)
            for key, fitted in ledger.fits.items()
            if len(key) == len(final)
            and len(set(key) & set(final)) == len(final) - 1
            and is_clearly_better(ledger, final, key)
            and not motion_is_hidden(ledger.effects(key), fitted)
        ]
        if not better:
            return final
        _, final = min(better)
        ledger.refine(final)


def is_clearly_better(ledger: FitLedger, final: Names, key: Names) -> bool:
    """Return whether a model fits better than another, on held-out records by a size that matters.

    It must gain as much as another form of an effect must.
    """
    criteria = ledger.study.criteria
    before, after = ledger.fits[final], ledger.fits[key]
    decrease = np.log(residual_rms(before) / residual_rms(after))
    return bool(
        after.cost < before.cost - criteria.form_gain
        and decrease.sum() > 0
        and decrease.max() > criteria.matters
    )
