"""What each effect of the final model contributes: the gap that comes back without it."""

from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names, Start


def contributions(
    ledger: FitLedger, nominal: FittedModel, final: Names, named: Names
) -> dict[str, float]:
    """Return the share of the gap that comes back if an effect is left out, the largest first.

    It is left out of the model of all effects named: one of those besides, as a shifted null, could
    stand for it, as a leak, so that nothing would come back. The model is fitted again without each
    effect, so that the others take over what they can, and simulated in windows of the records held
    out. Balances alone would not do: they count a short error after every reversal of the command
    as much as one that lasts and moves the axis. All shares refer to the gap of the nominal model;
    they need not sum up to what the model closes, since effects share parts of it. A model without
    an effect that cannot be fitted or simulated leaves the whole gap.

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
    back = {name: left[name] - left[""] for name in named}
    return dict(sorted(back.items(), key=lambda item: -item[1]))
