"""What each effect of the final model contributes: the gap that comes back without it."""

from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names, Start


def contributions(
    ledger: FitLedger, nominal: FittedModel, final: Names, named: Names
) -> dict[str, float]:
    """Return the share of the gap that comes back if an effect is left out, the largest first.

    The model is fitted again without each effect, so that the others take over what they can, and
    simulated in windows of the records held out. Balances alone would not do: they count a short
    error after every reversal of the command as much as one that lasts and moves the axis. All
    shares refer to the gap of the nominal model; they need not sum up to what the model closes,
    since effects share parts of it. A model without an effect that cannot be fitted or simulated
    leaves the whole gap.

    Parameters
    ----------
    final : tuple of str
        Effects of the model.
    named : tuple of str
        Those of which it is asked.
    """
    without = {name: ledger.key(set(final) - {name}) for name in named}
    values = ledger.fits[final].values
    starts: dict[Names, Start] = {key: Start(values) for key in without.values() if key}
    ledger.fit_all(starts)
    fits = {key: _fit_of(ledger, key) for key in (final, *starts)}
    ledger.simulate({key: fitted for key, fitted in fits.items() if fitted is not None})
    left = {
        key: 1.0
        if fitted is None
        else ledger.simulations.share(nominal, fitted, ledger.effects(key))
        for key, fitted in fits.items()
    }
    left[()] = 1.0
    back = {name: left[key] - left[final] for name, key in without.items()}
    return dict(sorted(back.items(), key=lambda item: -item[1]))


def _fit_of(ledger: FitLedger, names: Names) -> FittedModel | None:
    """Return the fit of a model, refined where it was; None where it failed."""
    return ledger.output_error_fits.get(names, ledger.fits.get(names))
