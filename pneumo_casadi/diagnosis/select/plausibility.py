"""A weak further effect is accepted if it makes implausible parameters plausible."""

import numpy as np

from pneumo_casadi.diagnosis.checks.parameter_checks import check_fit
from pneumo_casadi.diagnosis.metrics.residual_size import residual_rms
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names

#: Checks that count, by the property of the axis; the others have causes of their own.
KNOWN_BY = {"S_P": "areas", "S_N": "areas", "S_N/S_P": "areas", "F_c": "friction", "M": "mass"}


def find_plausible_extension(ledger: FitLedger, current: FittedModel, known: Names) -> Names | None:
    """Return a model with one more effect that makes all parameters plausible, or None.

    `accepted` requires a further effect to close a share of the first gap, since the misfit of a
    large effect is no second cause. If the first effect leaves several implausible parameters,
    and one more makes all of them plausible, it is accepted although its gain is small.

    Parameters
    ----------
    current : FittedModel
        The best model so far, with the effects `known`.
    """
    if not is_implausible(ledger, current, known):
        return None
    criteria = ledger.study.criteria
    better = {
        key: fitted
        for key, fitted in ledger.extensions(known).items()
        if fitted.cost < current.cost - criteria.plausible_gain
        and np.any(np.log(residual_rms(current) / residual_rms(fitted)) > criteria.matters)
    }
    for key in sorted(better, key=lambda key: better[key].cost):
        if not implausible_properties(ledger, key, better[key]):
            return key
    return None


def is_implausible(ledger: FitLedger, current: FittedModel, known: Names) -> bool:
    """Return whether a model with effects has several implausible parameters."""
    if not known:
        return False
    wrong = implausible_properties(ledger, known, current)
    return len(wrong) >= ledger.study.criteria.implausible


def implausible_properties(ledger: FitLedger, names: Names, fitted: FittedModel) -> set[str]:
    """Return the properties of the axis that a model with these effects makes implausible."""
    checks = check_fit(ledger.study, fitted, ledger.effects(names))
    return {KNOWN_BY[check.name] for check in checks if check.name in KNOWN_BY and not check.agrees}
