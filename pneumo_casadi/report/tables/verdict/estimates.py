"""Estimates of the fits that decide a verdict, beside those of the final model."""

from collections.abc import Mapping
from dataclasses import replace
from math import isfinite

from pneumo_casadi.diagnosis import Diagnosis, Value, Verdict
from pneumo_casadi.report.tables.diagnosis import (
    WITH_TERM,
    gap_table,
    has_after,
    ranking_table,
    regime_table,
    with_what,
)
from pneumo_casadi.report.tables.flow_form import flow_form_tables
from pneumo_casadi.report.tables.quantities import quantity
from pneumo_casadi.report.tables.table import Table, with_symbols
from pneumo_casadi.report.tables.verdict.parameter_checks import check_table

#: What parameters are worth while the cause is unknown.
WITHOUT_CAUSE = (
    "The cause is not in this model: the parameters may be off by far more than 2σ. Do not quote "
    "them."
)
#: What the estimates behind the verdict are for, and why they differ from those to use.
BALANCE_FITS = (
    "Fitted to the balances along the smoothed measured motion, to compare candidates. Smoothing "
    "takes a part of what is fast, such as the air in a hose, a lag or a reversal: this bias is "
    "not in their ± 2σ, nor is that of an incomplete model."
)
TO_USE = "Use the parameters of the final model refined by output error."
#: Heading of the final model.
FINAL = "final model, to use"


def fitted_table(diagnosis: Diagnosis, final: Mapping[str, Value] | None = None) -> Table:
    """Return all parameters without and with the effects found.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    final : mapping of str to Value, optional
        Parameters of the final model, to which the others are compared.
    """
    unknown = diagnosis.verdict is Verdict.UNKNOWN
    own = final if final is not None and not unknown else {}
    models = (diagnosis.nominal, diagnosis.fitted, diagnosis.with_term, own)
    names = dict.fromkeys([*diagnosis.fitted, *diagnosis.nominal, *diagnosis.with_term])
    every, names = len(names), dict.fromkeys(filter(_of_axis, names))
    rows = [(with_symbols(name), *(_cell(model.get(name)) for model in models)) for name in names]
    title = "Estimates of the fits that decide the verdict ± 2σ"
    notes = [f"{BALANCE_FITS} {WITHOUT_CAUSE if unknown else TO_USE}"]
    if every > len(names):
        notes.append("The coefficients of the flow map are in diagnosis.json.")
    apart = differing(diagnosis.fitted, own)
    if apart:
        notes.append(
            "Farther from the final model than both intervals together: "
            f"{', '.join(map(with_symbols, apart))}."
        )
    columns = ("", "without effects", with_what(diagnosis), WITH_TERM, FINAL)
    table = Table(title, columns, tuple(rows), tuple(notes))
    absent = [] if has_after(diagnosis) else [columns[2]]
    absent += [] if diagnosis.with_term else [WITH_TERM]
    table = table.without(*absent, *([] if own else [FINAL]))
    return table if len(table.columns) > 2 else replace(table, columns=("", "estimate"))


def differing(fitted: Mapping[str, Value], final: Mapping[str, Value]) -> list[str]:
    """Return the parameters whose intervals of ± 2σ do not meet.

    Examples
    --------
    >>> fitted = {"M": Value(16.0, 0.1, "kg"), "f_v": Value(30.0, 0.1, "N s/m")}
    >>> differing(fitted, {"M": Value(16.3, 0.1, "kg"), "f_v": Value(31.0, 0.1, "N s/m")})
    ['f_v']
    """
    both = {name: (value, final[name]) for name, value in fitted.items() if name in final}
    return [
        name
        for name, (first, second) in both.items()
        if isfinite(first.std) and isfinite(second.std) and first.std > 0 and second.std > 0
        if abs(first.value - second.value) > 2 * (first.std + second.std)
    ]


def _of_axis(name: str) -> bool:
    """Return whether a parameter is of the axis or an effect, not a coefficient of the flow map."""
    own = ("M", "f_v", "v_s", "S_P", "S_N")
    return "." in name or name.startswith(("X_s", "F_c_")) or name in own


def diagnosis_tables(
    diagnosis: Diagnosis, final: Mapping[str, Value] | None = None
) -> tuple[Table, ...]:
    """Return all tables of a diagnosis that have something to show, in order."""
    tables = (
        gap_table(diagnosis),
        regime_table(diagnosis),
        ranking_table(diagnosis),
        check_table(diagnosis),
        fitted_table(diagnosis, final),
        *flow_form_tables(diagnosis.flow_selection),
    )
    return tuple(table for table in tables if table.rows)


def _cell(value: Value | None) -> str:
    return "" if value is None else quantity(value)
