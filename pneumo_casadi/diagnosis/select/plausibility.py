"""Properties of the axis that a model makes implausible."""

from pneumo_casadi.diagnosis.checks.parameter_checks import check_fit
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names

#: Checks that count, by the property of the axis; the others have causes of their own.
KNOWN_BY = {"S_P": "areas", "S_N": "areas", "S_N/S_P": "areas", "F_c": "friction", "M": "mass"}


def implausible_properties(ledger: FitLedger, names: Names, fitted: FittedModel) -> set[str]:
    """Return the properties of the axis that a model with these effects makes implausible."""
    checks = check_fit(ledger.study, fitted, ledger.effects(names))
    return {KNOWN_BY[check.name] for check in checks if check.name in KNOWN_BY and not check.agrees}
