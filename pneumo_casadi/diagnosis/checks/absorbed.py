"""Effects that a refit may have absorbed, named by the parameter checks that fail."""

from collections.abc import Collection, Mapping, Sequence

from pneumo_casadi.diagnosis.metrics.findings import Check
from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.model.absorption import PARAMETER_CHECKS
from pneumo_casadi.model.effect import EffectFactory

#: Balance in whose parameters a check is; the others compare both chambers, or maps.
CHECKED_IN: Mapping[str, Location] = {
    "S_P": Location.MASS_FLOW_P,
    "k_P": Location.MASS_FLOW_P,
    "V_P(0)": Location.MASS_FLOW_P,
    "S_N": Location.MASS_FLOW_N,
    "k_N": Location.MASS_FLOW_N,
    "V_N(0)": Location.MASS_FLOW_N,
    "M": Location.FORCE,
    "F_c": Location.FORCE,
}


def contradicted_balance(checks: Sequence[Check]) -> Location:
    """Return the balance whose parameters the bench contradicts; none where there are several.

    Parameters
    ----------
    checks : sequence of Check
        From `check_parameters`.

    Examples
    --------
    >>> small = Check("S_N", 4e-4, 1e-6, 6e-4, 3e-5, "m2", False, "")
    >>> contradicted_balance([small])
    <Location.MASS_FLOW_N: 'mass_flow_N'>
    """
    failed = {CHECKED_IN[c.name] for c in checks if c.name in CHECKED_IN and not c.agrees}
    return failed.pop() if len(failed) == 1 else Location.NONE


def absorbed_candidates(
    checks: Sequence[Check],
    catalogue: Mapping[str, EffectFactory],
    shown_by: Collection[str] = PARAMETER_CHECKS,
) -> tuple[str, ...]:
    """Name the effects that the parameters may have absorbed, the most likely first.

    Parameters
    ----------
    checks : sequence of Check
        From `check_parameters`.
    catalogue : mapping of str to effect class
        Effects; each declares in `Effect.absorbed_by` which checks fail if it is absorbed.
    shown_by : collection of str, optional
        Checks by which an effect must show; all by default.

    Examples
    --------
    >>> from pneumo_casadi.effects import EFFECTS
    >>> heavy = Check("M", 20.0, 0.1, 17.0, 0.85, "kg", False, "")
    >>> absorbed_candidates([heavy], EFFECTS)
    ('elastic_load',)
    """
    failed = {check.name: check.value > check.expected for check in checks if not check.agrees}
    shown = {}
    for name, factory in catalogue.items():
        absorption = factory().absorbed_by
        check = None if absorption is None else absorption.first_failed(failed)
        if check in shown_by:
            shown[name] = PARAMETER_CHECKS.index(check)
    return tuple(sorted(shown, key=lambda name: shown[name]))
