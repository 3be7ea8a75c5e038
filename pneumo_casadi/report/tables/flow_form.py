"""The comparison of the forms of the flow map as a table."""

from pneumo_casadi.report.tables.table import Table
from pneumo_casadi.valve import FlowForm, FormError, FormSelection, Reason

#: A form in words.
FORMS = {
    FlowForm.POLYNOMIALS: "polynomials (eq. 12 of the paper)",
    FlowForm.ISO6358: "ISO 6358",
    FlowForm.ISO6358_CURVE: "ISO 6358 with curved openings",
    FlowForm.SPLINE: "spline",
}
_REASONS = {
    Reason.LEAST_ERROR: "it has the least held-out error",
    Reason.EQUALLY_WELL: (
        "its held-out error is within one standard error of the least one, and it comes first in "
        "the order of this table"
    ),
    Reason.ONLY_FORM: "no other form can be fitted to this map",
    Reason.TOO_FEW_POINTS: "the map has too few pressures for a comparison",
}


def flow_form_tables(selection: FormSelection | None) -> tuple[Table, ...]:
    """Return the held-out errors of the forms that were compared; no table where none were."""
    if selection is None or selection.reason is Reason.GIVEN:
        return ()
    rows = tuple(
        (_name(error), _error(error), "yes" if error.form is selection.chosen else "")
        for error in selection.candidates
    )
    notes = [f"{FORMS[selection.chosen]} is used: {_REASONS[selection.reason]}."]
    if selection.folds:
        notes.append(
            "Errors are those on withheld pressures and commands of the map, in "
            f"{selection.folds} folds, with their standard errors."
        )
        left_out = [error for error in selection.candidates if error.percent is None]
        notes += [f"{FORMS[error.form]} is not compared: {error.failure}." for error in left_out]
    if selection.chosen is FlowForm.SPLINE:
        notes.append("Output error refines only the gain of a spline, not its shape.")
    return (
        Table(
            "Form of the flow map",
            ("form", "held-out error [% of the largest flow]", "used"),
            rows,
            tuple(notes),
        ),
    )


def _name(error: FormError) -> str:
    if error.degrees is None:
        return FORMS[error.form]
    return f"{FORMS[error.form]}, degrees {', '.join(map(str, error.degrees))}"


def _error(error: FormError) -> str:
    if error.percent is None or error.standard_error is None:
        return "not compared"
    return f"{error.percent:.3f} ± {error.standard_error:.3f}"
