"""Parameters compared with geometry and data sheet, as a table, and what came of each check."""

from pneumo_casadi.diagnosis import Check, Diagnosis, Value
from pneumo_casadi.report.tables.quantities import DISPLAY_UNITS, quantity
from pneumo_casadi.report.tables.table import Table

#: What came of a check.
AGREES, CONTRADICTS, OPEN = "agrees", "contradicts", "cannot tell"
#: Checked quantities in words, where the name is not that of a symbol.
_CHECKED = {
    "V_P(0)": "dead length of P",
    "V_N(0)": "dead length of N",
    "k_P-k_N": "k_P − k_N",
    "F_c": "F_c⁺ − F_c⁻",
    "flow map": "residual of the flow map, over its own fit's",
    "map form": "error of the form of the flow map",
}
#: Why the intervals of ratios are not those of the tables of parameters.
_UNCORRELATED = (
    "± 2σ of dead lengths, of k and of ratios takes the coefficients as uncorrelated; the tables "
    "of parameters allow for their correlation.",
)
#: Units of checked quantities that have none of their own.
_CHECK_UNITS = {"map form": ("% of the largest flow", 100.0)}


def check_table(diagnosis: Diagnosis) -> Table:
    """Return the parameters beside the values expected from geometry and data sheet."""
    rows = []
    for check in diagnosis.final_checks:
        unit, factor = _CHECK_UNITS.get(check.name) or DISPLAY_UNITS.get(
            check.unit, (check.unit, 1.0)
        )
        value = Value(check.value * factor, check.std * factor, "")
        expected, tolerance = check.expected * factor, check.tolerance * factor
        rows.append(
            (
                _CHECKED.get(check.name, check.name),
                unit,
                quantity(value, held=""),
                f"{_bound(expected - tolerance)} to {_bound(expected + tolerance)}",
                _agreement(check),
            )
        )
    near = (
        "Within 6σ: outside the range by less than six standard deviations, which do not include "
        "the bias of the fit.",
    )
    gross = (
        "Cannot tell: the range of a dead length, of k_P − k_N and of friction excludes gross "
        "errors only, and so does any range narrower than six standard deviations of its estimate. "
        "Such checks are not counted.",
    )
    results = {row[-1] for row in rows}
    which = "the final model" if diagnosis.refined_checks else "the fits that decide the verdict"
    return Table(
        "Parameters compared with geometry and data sheet",
        ("", "unit", "estimate ± 2σ", "expected", "agrees"),
        tuple(rows),
        (
            f"Estimates of {which}.",
            *_UNCORRELATED,
            *(near if "within 6σ" in results else ()),
            *(gross if OPEN in results else ()),
        ),
    )


def check_result(check: Check) -> str:
    """Return what came of a check: one that nothing could contradict does not agree."""
    if not check.agrees:
        return CONTRADICTS
    return AGREES if check.decisive else OPEN


def _agreement(check: Check) -> str:
    if check_result(check) is not AGREES:
        return "NO" if not check.agrees else OPEN
    return "yes" if abs(check.value - check.expected) <= check.tolerance else "within 6σ"


def _bound(value: float) -> str:
    return f"{value:.3g}" if abs(value) > 1e-9 else "0"
