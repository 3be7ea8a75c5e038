"""The tables of a diagnosis."""

from collections.abc import Iterator, Mapping

from pneumo_casadi.diagnosis import Candidate, Diagnosis
from pneumo_casadi.report.tables.quantities import between, chance, percent, whole
from pneumo_casadi.report.tables.table import Table, cause_name, plain

#: Balances in words.
BALANCES = {
    "mass_flow_P": "mass flow into chamber P",
    "mass_flow_N": "mass flow into chamber N",
    "force": "force on the moving mass",
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
#: Candidates shown at most; the JSON file has them all.
SHOWN = 12
#: A candidate that is not named matters from this probability on, or from this share of the gap
#: that it removes or is predicted to remove [1].
PROBABLE, REMOVES = 0.01, 0.1
#: Smallest probability of a cause outside the catalogue that is reported.
OUTSIDE = 0.1


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
        return "with the effect" if len(diagnosis.final_effects) == 1 else "with the effects"
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
    fit, the linearised model predicts that it would. What some of the effects found remove with
    others is their doing.
    """
    if builds_on_found(diagnosis, candidate):
        return candidate.probability >= PROBABLE
    shares = (candidate.probability >= PROBABLE, candidate.explained >= REMOVES)
    if candidate.failure:
        return any(shares)
    named = {item for each in diagnosis.final_effects for item in (each.name, *each.rivals)}
    if candidate.names in diagnosis.ambiguous or (named and named.issuperset(candidate.names)):
        return True
    closure = candidate.closure
    return shares[0] or (shares[1] if closure is None else closure.value >= REMOVES)


def builds_on_found(diagnosis: Diagnosis, candidate: Candidate) -> bool:
    """Return whether a candidate holds effects that were found, and others besides."""
    effects = {effect.name for effect in diagnosis.final_effects}
    names = set(candidate.names)
    return bool(names & effects) and bool(names - effects)


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


def _short(name: str) -> str:
    return {"mass_flow_P": "mass flow P", "mass_flow_N": "mass flow N"}.get(name, name)


def _share_removed(before: float, after: float) -> str:
    return "" if before <= 0 else whole(1 - after / before)
