"""Another end of a selection: effects that a term outside the catalogue has led to.

Forward selection goes astray where no effect alone shows what two do together. Beside a term that
takes up part of it the others may show; where they then explain the gap without the term, they are
what was looked for.
"""

from dataclasses import replace

import numpy as np

from pneumo_casadi.diagnosis.metrics.residual_size import residual_rms
from pneumo_casadi.diagnosis.prepare.fitted_model import FAULTS
from pneumo_casadi.diagnosis.select.complete import complete
from pneumo_casadi.diagnosis.select.contributions import contributions
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names
from pneumo_casadi.diagnosis.select.forward_selection import MAX_SELECTED, Selection
from pneumo_casadi.diagnosis.select.hidden_motion import motion_is_hidden
from pneumo_casadi.diagnosis.select.propose import fit_extensions


def reselect(ledger: FitLedger, selection: Selection, names: Names) -> Selection | None:
    """Return the selection with other effects at its end, completed; None where they leave a gap.

    They must leave no gap of any balance that would be visible: beside a term that is the cause,
    effects that are not there were found as well, and left two floors.

    Parameters
    ----------
    ledger : FitLedger
        With a fit of these effects.
    selection : Selection
        The one so far.
    names : tuple of str
        The effects.
    """
    fitted, levels = ledger.fits.get(names), selection.levels
    if fitted is None or names == selection.chosen:
        return None
    left = residual_rms(fitted) / levels.noise
    if np.any(left > levels.criteria.coarse_map) or motion_is_hidden(ledger.effects(names), fitted):
        return None
    try:
        completed = complete(ledger, selection.nominal, names, levels)
    except FAULTS:
        return None
    shares = contributions(ledger, selection.nominal, completed.acting, completed.named, levels)
    fits = {**selection.fits, **ledger.fits}
    failures = {f.effects: f for f in (*selection.failures, *ledger.failures.values())}.values()
    return replace(
        selection,
        fits=fits,
        failures=tuple(failed for failed in failures if failed.effects not in fits),
        path=(names,),
        completed=completed,
        contributions=shares,
    )


def reselect_further(ledger: FitLedger, selection: Selection, names: Names) -> Selection | None:
    """Return the selection with one more effect at its end, where the search had stopped before.

    A model of `MAX_SELECTED` effects is not extended where it explains too little: beside a cause
    that no effect has, each further one would be a stand-in. One that leaves no gap is none. A weak
    spring beside a drag and two more effects had come out as a term, a line over x.

    Parameters
    ----------
    ledger, selection, names
        As of `reselect`.
    """
    if len(names) < MAX_SELECTED or names not in ledger.fits:
        return None
    fit_extensions(ledger, selection.nominal, ledger.fits[names], names, selection.levels)
    further = ledger.extensions(names)
    if not further:
        return None
    return reselect(ledger, selection, min(further, key=lambda key: further[key].cost))
