"""A further effect that is small beside the gap of the first, but mends what no axis can have."""

import numpy as np

from pneumo_casadi.diagnosis.checks.parameter_checks import check_fit
from pneumo_casadi.diagnosis.metrics.residual_size import residual_rms
from pneumo_casadi.diagnosis.prepare.study import FittedModel
from pneumo_casadi.diagnosis.select.acceptance import MATTERS
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names

#: What an axis is known by; other checks have causes of their own.
KNOWN_BY = {"S_P": "areas", "S_N": "areas", "S_N/S_P": "areas", "F_c": "friction", "M": "mass"}
#: So many of these must be wrong: one alone may come from what the form of an effect misses.
WRONG = 2
#: Log-likelihood that an effect must gain beside what its mending says for it.
GAIN = 100.0


def find_plausible_extension(ledger: FitLedger, current: FittedModel, known: Names) -> Names | None:
    """Return a model with one more effect with which all parameters are possible, or None.

    What the form of a large effect misses is no second cause, so a further one is asked to close
    a share of the first gap (`accepted`). Where friction that pushes along the motion and pistons
    that the bench has not come out with the first effect, and one more puts all of them right,
    that tells more than the size of the gap.

    Parameters
    ----------
    current : FittedModel
        The best model so far, with the effects `known`.
    """
    if not known or len(_wrong(ledger, known, current)) < WRONG:
        return None
    better = {
        key: fitted
        for key, fitted in ledger.extensions(known).items()
        if fitted.cost < current.cost - GAIN
        and np.any(np.log(residual_rms(current) / residual_rms(fitted)) > MATTERS)
    }
    for key in sorted(better, key=lambda key: better[key].cost):
        if not _wrong(ledger, key, better[key]):
            return key
    return None


def _wrong(ledger: FitLedger, names: Names, fitted: FittedModel) -> set[str]:
    checks = check_fit(ledger.study, fitted, ledger.effects(names))
    return {KNOWN_BY[check.name] for check in checks if check.name in KNOWN_BY and not check.agrees}
