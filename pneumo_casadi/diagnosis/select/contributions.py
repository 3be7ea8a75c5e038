"""What each effect of the final model contributes: the gap that comes back without it."""

from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels, overall_gap
from pneumo_casadi.diagnosis.prepare.study import FittedModel
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names, Start


def contributions(
    ledger: FitLedger, nominal: FittedModel, final: Names, levels: BalanceLevels
) -> dict[str, float]:
    """Return the share of the gap that comes back if an effect is left out, the largest first.

    The model is fitted again without each effect, so that the others take over what they can. All
    shares refer to the held-out gap of the nominal model; they need not sum up to what the model
    closes, since effects share parts of it. A model without an effect that cannot be fitted leaves
    the whole gap.

    Parameters
    ----------
    final : tuple of str
        Effects of the model.
    """
    without = {name: ledger.key(set(final) - {name}) for name in final}
    values = ledger.fits[final].values
    starts: dict[Names, Start] = {key: (values, (), None) for key in without.values() if key}
    ledger.fit_all(starts)
    known = {(): nominal, **ledger.fits}
    before = overall_gap(nominal, levels)
    after = overall_gap(ledger.fits[final], levels)
    if before == 0.0:
        return dict.fromkeys(final, 0.0)
    back = {
        name: (overall_gap(known.get(key, nominal), levels) - after) / before
        for name, key in without.items()
    }
    return dict(sorted(back.items(), key=lambda item: -item[1]))
