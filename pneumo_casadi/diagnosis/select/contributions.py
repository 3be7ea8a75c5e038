"""What each effect of the final model contributes to closing the gap."""

from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names, Start


def contributions(
    ledger: FitLedger, nominal: FittedModel, final: Names, named: Names
) -> dict[str, float]:
    """Return the share of the gap that each effect closes, the largest first.

    It is the mean of what the effect closes as the only one, and what comes back if it is left out
    of the final model: of two effects, this is the value that Shapley gives them. What comes back
    would not do alone: of two effects that can stand for each other, as a leak and a shifted null,
    neither is missed. The models are fitted anew, so that others take over what they can, and
    simulated in windows of the records held out. Balances would not do: they count a short
    error after every reversal of the command as much as one that lasts and moves the axis. All
    shares refer to the gap of the nominal model. A model that cannot be fitted or simulated leaves
    the whole gap.

    Parameters
    ----------
    final : tuple of str
        Effects of the model.
    named : tuple of str
        Those of which it is asked.
    """
    models: dict[Names, FittedModel | None] = {final: ledger.fits[final]}
    alone = {name: ledger.key({name}) for name in named}
    without = {name: ledger.key(set(final) - {name}) for name in named}
    if len(final) > 1:
        start = Start(ledger.fits[final].values)
        ledger.fit_all(dict.fromkeys(alone.values(), start))
        models |= {key: ledger.fits.get(key) for key in alone.values()}
        fits = ledger.fit_without(final, named)
        models |= {without[name]: fits[name] for name in named}
    refined = {key: ledger.output_error_fits.get(key, fit) for key, fit in models.items()}
    ledger.simulate({key: fit for key, fit in refined.items() if fit is not None})
    left = {
        key: 1.0 if fit is None else ledger.simulations.share(nominal, fit, ledger.effects(key))
        for key, fit in refined.items()
    }
    left.setdefault((), 1.0)  # without its only effect the model is the nominal one
    closed = {
        name: (1.0 - left[alone[name]] + left[without[name]] - left[final]) / 2 for name in named
    }
    return dict(sorted(closed.items(), key=lambda item: -item[1]))
