"""What each effect of the final model contributes: the gap that comes back without it."""

from collections.abc import Mapping

import numpy as np

from pneumo_casadi.diagnosis.metrics.residual_size import (
    BalanceLevels,
    balance_closure,
    gain_on_all_records,
)
from pneumo_casadi.diagnosis.metrics.simulated_fit import WINDOW
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names, Start

#: Windows too short for a drift [s]: in open loop a weak leak, once left out, takes the motion
#: further off than a strong restriction within half a second, but not within a fifth of it.
SHORT = 0.1
#: Samples of such a window, at least: fewer tell little more than the states it begins with.
FEWEST = 20
#: Share of the gap, and log-likelihood, of which less counts as nothing: the other one decides.
LEAST_GAP, LEAST_GAIN = 1e-3, 1.0


def contributions(
    ledger: FitLedger, nominal: FittedModel, final: Names, named: Names, levels: BalanceLevels
) -> dict[str, float]:
    """Return the share of the gap that comes back if an effect is left out, the most missed first.

    It is left out of the model of all effects named: one of those besides, as a shifted null, could
    stand for it, as a leak, so that nothing would come back. The model is fitted again without each
    effect, so that the others take over what they can, and simulated in windows of the records held
    out. All shares refer to the gap of the nominal model; they need not sum up to what the model
    closes, since effects share parts of it. A model without an effect that cannot be fitted or
    simulated leaves the whole gap. Where the model of all of them or the nominal one cannot be
    simulated, or simulations show no gap, it is that of the balances.

    The most missed effect is the one with the largest product of the log-likelihood that its
    absence costs in the balances and the gap that comes back in short windows. Balances alone would
    not do: they count a short error after every reversal of the command as much as one that lasts
    and moves the axis. Simulation alone would not do either: it makes much of what drifts.

    Parameters
    ----------
    final : tuple of str
        Effects of the model.
    named : tuple of str
        Those of which it is asked.
    levels : BalanceLevels
        Noise and signal of the balances.
    """
    whole = ledger.key(named)
    if whole != final:
        ledger.fit_all({whole: Start(ledger.fits[final].values)})
    final = whole if whole in ledger.fits else final
    fits = ledger.fit_without(final, named) if len(final) > 1 else dict.fromkeys(named)
    models = {name: (ledger.key(set(final) - {name}), fit) for name, fit in fits.items()}
    models[""] = final, ledger.fits[final]
    refined = {
        name: (key, ledger.output_error_fits.get(key, fit)) for name, (key, fit) in models.items()
    }
    needed = {(): nominal} | {key: fit for key, fit in refined.values() if fit is not None}
    enough = FEWEST * max(record.dt for record in ledger.study.held_out)
    short = min(WINDOW, max(SHORT, enough))
    ledger.begin_simulations(needed)
    if len(named) > 1:
        ledger.begin_simulations(needed, short)
    back = _gap_back(ledger, nominal, refined, WINDOW, levels)
    if len(named) == 1:
        return back
    soon = _gap_back(ledger, nominal, refined, short, levels)
    missed = {
        name: np.inf
        if fit is None
        else max(LEAST_GAP, soon[name])
        * max(LEAST_GAIN, gain_on_all_records(fit, ledger.fits[final]))
        for name, fit in fits.items()
    }
    return {name: back[name] for name in sorted(named, key=lambda name: -missed[name])}


def _gap_back(
    ledger: FitLedger,
    nominal: FittedModel,
    models: Mapping[str, tuple[Names, FittedModel | None]],
    window: float,
    levels: BalanceLevels,
) -> dict[str, float]:
    """Return the share of the gap in windows [s] that comes back in each of the reduced models.

    Of the gap of the balances where windows do not tell what the whole model, keyed "", leaves.
    """
    key, final = models[""]
    whole_runs = final is not None and ledger.simulations.tells(
        nominal, final, ledger.effects(key), window
    )

    def left_by(key: Names, fit: FittedModel) -> float:
        if whole_runs:
            return ledger.simulations.share(nominal, fit, ledger.effects(key), window)
        return 1.0 - balance_closure(nominal, fit, levels).value

    left = {name: 1.0 if fit is None else left_by(key, fit) for name, (key, fit) in models.items()}
    whole = left.pop("")
    return {name: share - whole for name, share in left.items()}
