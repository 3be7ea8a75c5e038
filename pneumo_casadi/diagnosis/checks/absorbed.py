"""Effects that may hide in the parameters, told by the checks that fail."""

from collections.abc import Sequence

from pneumo_casadi.diagnosis.metrics.findings import Check


def absorbed_candidates(checks: Sequence[Check]) -> tuple[str, ...]:
    """Name the effects that may hide in the parameters, the most likely first.

    Parameters
    ----------
    checks : sequence of Check
        From `check_parameters`.

    Examples
    --------
    >>> absorbed_candidates(())
    ()
    """
    failed = {check.name: check for check in checks if not check.agrees}
    found: list[str] = []
    if "S_N/S_P" in failed:
        # A valve of other gain scales X_s4 ... X_s6 alike: k_N and V_N(0) stay what they were.
        alone = not {"k_N", "k_P", "k_P-k_N", "V_N(0)", "V_P(0)"} & failed.keys()
        too_large = failed["S_N/S_P"].value > failed["S_N/S_P"].expected
        leak = "leakage_N" if too_large else "leakage_P"
        found += ["valve_mismatch"] if alone else [leak, "valve_mismatch"]
    if "F_c" in failed:
        found += ["constant_force", "pressure_sensor_bias"]
    if "map form" in failed:
        found += ["flow_map_shape"]
    elif {"S_P", "S_N"} <= failed.keys() and "S_N/S_P" not in failed:
        found += ["supply_droop"]
    if {"k_P", "k_N", "k_P-k_N"} & failed.keys():
        found += ["heat_transfer"]
    if any(
        name in failed and failed[name].value > failed[name].expected
        for name in ("V_P(0)", "V_N(0)")
    ):
        found += ["hose"]
    if "M" in failed:
        found += ["elastic_load"]
    if "flow map" in failed or "flow scale" in failed:
        found += ["valve_null_shift"]
    return tuple(dict.fromkeys(found))
