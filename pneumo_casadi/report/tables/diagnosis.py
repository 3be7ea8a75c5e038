"""The tables of a diagnosis."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from pneumo_casadi.diagnosis import Candidate, Check, Diagnosis, Value, Verdict
from pneumo_casadi.report.tables.flow_form import flow_form_tables
from pneumo_casadi.report.tables.quantities import (
    DISPLAY_UNITS,
    between,
    chance,
    percent,
    plain,
    quantity,
    whole,
)
from pneumo_casadi.report.tables.table import Table, cause_name, with_symbols

#: Balances in words.
BALANCES = {
    "mass_flow_P": "mass flow into chamber P",
    "mass_flow_N": "mass flow into chamber N",
    "force": "force on the piston",
    "measurement": "reading of a sensor",
    "none": "none",
}
#: How the gap is measured, in the order in which the views are shown.
VIEWS = {
    "windows": "open loop, windows of 0.5 s",
    "closed_loop": "closed loop",
    "balances": "residuals of the balances",
}
#: What a view means that its name does not say.
MEANINGS = {
    "closed_loop": (
        "Closed loop: from its first state to the end of the record the model follows the "
        "reference, under the controller of bench.json."
    ),
    "balances": (
        "Residuals of the balances: left minus right side of the balances of mass flow and "
        "force, along the measured motion."
    ),
}
#: The gap, defined where it first appears in a report.
GAP_DEFINITION = (
    "Gap: error of the simulation on held-out data beyond the sensor noise, in per cent of the "
    "signal's standard deviation."
)
#: Name of the model with a discovered term.
WITH_TERM = "with the discovered term"
#: What parameters are worth while the cause is unknown.
WITHOUT_CAUSE = (
    "The cause is not in this model: the parameters may be off by far more than 2σ. Do not quote "
    "them."
)
#: What the estimates behind the verdict are for.
BALANCE_FITS = (
    "Fitted to the balances along the smoothed measured motion, to compare candidates. ± 2σ does "
    "not include the bias of smoothing, nor that of an incomplete model."
)
TO_USE = "Use the parameters of the final model refined by output error."
#: Candidates shown at most; the JSON file has them all.
SHOWN = 12
#: A candidate that is not named matters from this probability on, or from this share of the gap
#: that it removes or is predicted to remove [1].
PROBABLE, REMOVES = 0.01, 0.1
#: Smallest probability of a cause outside the catalogue that is reported.
OUTSIDE = 0.1


def diagnosis_tables(diagnosis: Diagnosis) -> tuple[Table, ...]:
    """Return all tables of a diagnosis that have something to show, in order."""
    tables = (
        gap_table(diagnosis),
        regime_table(diagnosis),
        ranking_table(diagnosis),
        check_table(diagnosis),
        fitted_table(diagnosis),
        *flow_form_tables(diagnosis.flow_selection),
    )
    return tuple(table for table in tables if table.rows)


def gap_table(diagnosis: Diagnosis) -> Table:
    """Return the gap by view and output, without effects and with them."""
    models = gap_models(diagnosis)
    rows = []
    for view, name, values in gap_rows(diagnosis):
        sizes = [values.get(key) for key in models]
        cells = ["" if size is None else percent(size) for size in sizes]
        removed = "" if sizes[-1] is None else _share_removed(values["before"], sizes[-1])
        label = f"{VIEWS.get(view, plain(view))}: {_short(name)}"
        rows.append((label, *cells, removed, percent(values["noise"])))
    table = Table(
        "Gap on held-out data",
        ("", *models.values(), "reduction", "sensor noise"),
        tuple(rows),
        tuple(text for view, text in MEANINGS.items() if diagnosis.gap.views.get(view)),
    )
    return table if len(models) > 1 else table.without("reduction")


def gap_models(diagnosis: Diagnosis) -> dict[str, str]:
    """Return the models whose gap was simulated: keys of the views, and names."""
    models = {"before": "without effects"}
    if has_after(diagnosis):
        models["after"] = with_what(diagnosis)
    if diagnosis.gap.with_term is not None:
        models["with_term"] = WITH_TERM
    return models


def has_after(diagnosis: Diagnosis) -> bool:
    """Return whether the gap was simulated with effects too."""
    return bool(diagnosis.effects) or diagnosis.gap.after != diagnosis.gap.before


def nearest(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return the effects of the best candidate where no effect is the cause."""
    own = [name for name in diagnosis.fitted if name not in diagnosis.nominal]
    new = [cause_name(name.partition(".")[0]) for name in own]
    return tuple(dict.fromkeys(new))


def with_what(diagnosis: Diagnosis) -> str:
    """Return the name of the model with effects."""
    if diagnosis.effects:
        return "with the effect" if len(diagnosis.effects) == 1 else "with the effects"
    return "with the best candidate"


def gap_rows(diagnosis: Diagnosis) -> Iterator[tuple[str, str, Mapping[str, float]]]:
    """Yield view, output or balance, and its gap, in the order in which they are shown."""
    views = diagnosis.gap.views
    for view in (*VIEWS, *(name for name in views if name not in VIEWS)):
        for name, values in views.get(view, {}).items():
            yield view, name, values


def regime_table(diagnosis: Diagnosis) -> Table:
    """Return the conditions under which the residual of a balance is large."""
    rows = [
        (
            f"{regime.name}",
            _short(regime.balance),
            whole(regime.share),
            whole(regime.time),
            f"{regime.ratio:.2g}",
            "< 0.001" if regime.p_value <= 1e-3 else f"{regime.p_value:.2g}",
        )
        for regime in diagnosis.where.regimes
    ]
    return Table(
        "Conditions under which the residual is large",
        ("condition", "balance", "share of residual", "share of time", "ratio", "p"),
        tuple(rows),
        (
            "Share of residual: of the squared residual of the balance. For a frequency band, "
            "share of time is the share of the signal.",
            "p: probability of such a share if the residuals are shuffled in blocks.",
            "Conditions overlap: their shares do not add up to 100 %.",
        ),
    )


def matters(diagnosis: Diagnosis, candidate: Candidate) -> bool:
    """Return whether a candidate is part of the conclusion, or could have been.

    It is named, has a probability worth a look, or removes a tenth of the gap; where there is no
    fit, the linearised model predicts that it would. What the effects found remove with a further
    one is their doing.
    """
    if contains_found(diagnosis, candidate):
        return candidate.probability >= PROBABLE
    shares = (candidate.probability >= PROBABLE, candidate.explained >= REMOVES)
    if candidate.failure:
        return any(shares)
    named = {item for each in diagnosis.final_effects for item in (each.name, *each.rivals)}
    if candidate.names in diagnosis.ambiguous or (named and named.issuperset(candidate.names)):
        return True
    closure = candidate.closure
    return shares[0] or (shares[1] if closure is None else closure.value >= REMOVES)


def contains_found(diagnosis: Diagnosis, candidate: Candidate) -> bool:
    """Return whether a candidate is the effects found with further ones."""
    effects = {effect.name for effect in diagnosis.final_effects}
    return bool(effects) and effects < set(candidate.names)


def ranking_table(diagnosis: Diagnosis) -> Table:
    """Return the candidates that matter, the most probable first, and fits of such that failed."""
    shown = [item for item in diagnosis.ranking if matters(diagnosis, item)]
    rows = [
        (
            plain(candidate.label),
            chance(candidate.probability),
            *_reduction(candidate),
            whole(candidate.observable),
        )
        for candidate in shown[:SHOWN]
    ]
    outside = 1 - sum(candidate.probability for candidate in diagnosis.ranking)
    if rows and outside > OUTSIDE:
        rows.append(("none of the catalogue", chance(outside), "", "", ""))
    return Table(
        "Candidates",
        ("", "probability", "closes in the balances", "95 % interval", "identifiable"),
        tuple(rows),
        (
            "Closes in the balances: share of the held-out gap in the balances that the candidate "
            "removes. In simulations errors add up, so that this share differs from the reduction "
            "of the gap there.",
            "Identifiable: share of its influence that the other parameters cannot reproduce.",
        ),
    )


def _reduction(candidate: Candidate) -> tuple[str, str]:
    if candidate.failure:
        return "fit failed", ""
    if candidate.closure is None:
        return f"not fitted ({whole(candidate.explained)} predicted)", ""
    return whole(candidate.closure.value), between(candidate.closure)


#: Checked quantities in words, where the name is not that of a symbol.
_CHECKED = {
    "V_P(0)": "dead length of P",
    "V_N(0)": "dead length of N",
    "k_P-k_N": "k_P − k_N",
    "F_c": "F_c⁺ − F_c⁻",
    "flow map": "residual of the flow map, over its own fit's",
    "map form": "error of the form of the flow map",
}
#: Units of checked quantities that have none of their own.
_CHECK_UNITS = {"map form": ("% of the largest flow", 100.0)}


def check_table(diagnosis: Diagnosis) -> Table:
    """Return the parameters beside the values expected from geometry and data sheet."""
    rows = []
    for check in diagnosis.checks:
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
    return Table(
        "Parameters compared with geometry and data sheet",
        ("", "unit", "estimate ± 2σ", "expected", "agrees"),
        tuple(rows),
        (
            "Estimates of the fits that decide the verdict. The range of a dead length, of "
            "k_P − k_N and of friction is what is plausible, and excludes gross errors.",
            *(near if any(row[-1] == "within 6σ" for row in rows) else ()),
        ),
    )


def _agreement(check: Check) -> str:
    if abs(check.value - check.expected) <= check.tolerance:
        return "yes"
    return "within 6σ" if check.agrees else "NO"


def _bound(value: float) -> str:
    return f"{value:.3g}" if abs(value) > 1e-9 else "0"


def fitted_table(diagnosis: Diagnosis) -> Table:
    """Return all parameters without and with the effects found."""
    models = (diagnosis.nominal, diagnosis.fitted, diagnosis.with_term)
    names = dict.fromkeys([*diagnosis.fitted, *diagnosis.nominal, *diagnosis.with_term])
    rows = [(with_symbols(name), *(_cell(model.get(name)) for model in models)) for name in names]
    title = "Estimates of the fits that decide the verdict ± 2σ"
    unknown = diagnosis.verdict is Verdict.UNKNOWN
    notes = (f"{BALANCE_FITS} {WITHOUT_CAUSE if unknown else TO_USE}",)
    columns = ("", "without effects", with_what(diagnosis), WITH_TERM)
    table = Table(title, columns, tuple(rows), notes)
    absent = [] if has_after(diagnosis) else [columns[2]]
    table = table.without(*absent, *([] if diagnosis.with_term else [WITH_TERM]))
    return table if len(table.columns) > 2 else replace(table, columns=("", "estimate"))


def _cell(value: Value | None) -> str:
    return "" if value is None else quantity(value)


def _short(name: str) -> str:
    return {"mass_flow_P": "mass flow P", "mass_flow_N": "mass flow N"}.get(name, name)


def _share_removed(before: float, after: float) -> str:
    return "" if before <= 0 else whole(1 - after / before)
