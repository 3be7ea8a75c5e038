"""What each effect of the final model contributes: the gap that comes back without it."""

import numpy as np

from pneumo_casadi.diagnosis.metrics.residual_size import gain_on_all_records
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names, Start


def contributions(
    ledger: FitLedger, nominal: FittedModel, final: Names, named: Names
) -> dict[str, float]:
    """Return the share of the gap that comes back if an effect is left out, the most missed first.

    It is left out of the model of all effects named: one of those besides, as a shifted null, could
    stand for it, as a leak, so that nothing would come back. The model is fitted again without each
    effect, so that the others take over what they can.

    Which one is missed most, the score of the selection tells: the log-likelihood lost in the
    balances. The share is that of the simulated gap in windows of the records held out. It tells
    how far the motion is off, but is no measure of the cause: in open loop a weak leak drifts
    further than a strong restriction. All shares refer to the gap of the nominal model; they need
    not sum up to what the model closes, since effects share parts of it. A model without an effect
    that cannot be fitted or simulated leaves the whole gap, and is missed most.

    Parameters
    ----------
    final : tuple of str
        Effects of the model.
    named : tuple of str
        Those of which it is asked.
    """
    whole, complete = ledger.key(named), final
    if whole != final:
        ledger.fit_all({whole: Start(ledger.fits[final].values)})
    final = whole if whole in ledger.fits else final
    fits = ledger.fit_without(final, named) if len(final) > 1 else dict.fromkeys(named)
    models = {name: (ledger.key(set(final) - {name}), fit) for name, fit in fits.items()}
    models[""] = final, ledger.fits[final]
    refined = {
        name: (key, ledger.output_error_fits.get(key, fit)) for name, (key, fit) in models.items()
    }
    simulated = {key: fit for key, fit in refined.values() if fit is not None}
    simulated[complete] = ledger.output_error_fits.get(complete, ledger.fits[complete])
    ledger.simulate({(): nominal} | simulated)  # both are told of as well
    left = {
        name: 1.0 if fit is None else ledger.simulations.share(nominal, fit, ledger.effects(key))
        for name, (key, fit) in refined.items()
    }
    lost = {
        name: np.inf if fit is None else gain_on_all_records(fit, ledger.fits[final])
        for name, fit in fits.items()
    }
    return {name: left[name] - left[""] for name in sorted(named, key=lambda name: -lost[name])}
