"""The figures of a diagnosis with their captions, in the order of the report."""

from collections.abc import Iterator

from pneumo_casadi.diagnosis import Diagnosis, Verdict
from pneumo_casadi.diagnosis.locate.evidence import Evidence
from pneumo_casadi.report.figures.diagnosis.dashboard import dashboard_figure
from pneumo_casadi.report.figures.diagnosis.discovered_term import discovered_term_figure
from pneumo_casadi.report.figures.diagnosis.gap import gap_figure, gap_labels
from pneumo_casadi.report.figures.diagnosis.ranking import ranking_figure
from pneumo_casadi.report.figures.diagnosis.regimes import regime_figure
from pneumo_casadi.report.figures.diagnosis.unknown_inputs import unknown_input_figure
from pneumo_casadi.report.figures.diagnosis.where import where_figure
from pneumo_casadi.report.figures.time_series import time_series_figure
from pneumo_casadi.report.pages.identification_figures import Drawn
from pneumo_casadi.report.tables.diagnosis import gap_models, has_after
from pneumo_casadi.report.tables.quantities import chance, percent, whole
from pneumo_casadi.report.tables.table import plain
from pneumo_casadi.report.text.causes import joined

#: A balance is drawn in detail from this share of the unknown inputs.
SHARE = 0.1


def diagnosis_figures(diagnosis: Diagnosis) -> Iterator[Drawn]:
    """Draw all figures of a diagnosis, in order; curves where it carries its evidence."""
    for curves in () if diagnosis.evidence is None else diagnosis.evidence.simulations:
        yield Drawn(
            f"validation_{curves.record}",
            time_series_figure(curves),
            f"Held-out record {curves.record}, measured and simulated over windows of 0.5 s, "
            f"{' and '.join(curves.simulations)}; each window starts at an estimated state. Below, "
            "measured minus simulated, averaged over 20 ms; the band is ±2σ of one sensor sample. "
            "Right: the part with the largest difference, shaded on the left.",
        )
    if diagnosis.gap.views:
        yield Drawn(
            "gap",
            gap_figure(diagnosis),
            "Gap (error of the simulation beyond the sensor noise) on held-out data, "
            f"{joined(list(gap_models(diagnosis).values()))}, in per cent of each signal; the "
            "black mark is the sensor noise. " + _gap_words(diagnosis),
        )
    if any(
        candidate.closure is not None or candidate.probability > 0
        for candidate in diagnosis.ranking
    ):
        yield Drawn(
            "ranking",
            ranking_figure(diagnosis),
            ("None is needed. " if diagnosis.verdict is Verdict.NONE else "")
            + "The most probable causes, and the share of the held-out gap in the balances that "
            "each closes, with its 95 % interval. " + _ranking_words(diagnosis),
        )
    if any(diagnosis.where.shares.values()) or diagnosis.where.regimes:
        yield Drawn(
            "where",
            where_figure(diagnosis),
            (
                "What the effects found add to each balance, root mean squares over the balance's "
                "signal; an effect in a sensor is not drawn. "
                if any(diagnosis.where.sizes.values())
                else "Share of each balance in the unknown inputs of the model without effects. "
            )
            + "Below, the conditions with a larger share of the residual than of the time (for a "
            "frequency band: than of the signal).",
        )
    if diagnosis.evidence is not None:
        yield from _curves(diagnosis, diagnosis.evidence)
    if diagnosis.discovered is not None:
        yield Drawn(
            "discovered_term",
            discovered_term_figure(diagnosis.discovered),
            "The discovered term over its driver: the smooth curve that the residuals ask for, "
            "with its 95 % band, and the formula. What the parameters of the model take up as "
            "well, a constant for one, is left out of the curve; the formula is shifted to its "
            "mean.",
        )
    if diagnosis.gap.views and diagnosis.ranking and any(diagnosis.where.shares.values()):
        yield Drawn(
            "dashboard",
            dashboard_figure(diagnosis),
            "Summary of the diagnosis: gap, most probable causes, affected balances, and the "
            f"unknown input of the most affected one. {_gap_words(diagnosis)} "
            f"{_ranking_words(diagnosis)}",
        )


def _curves(diagnosis: Diagnosis, evidence: Evidence) -> Iterator[Drawn]:
    several = len(evidence.inputs) > 1
    for i, inputs in enumerate(evidence.inputs, 1):
        which = f", held-out record {i}" if several else ""
        yield Drawn(
            f"unknown_inputs_{i}" if several else "unknown_inputs",
            unknown_input_figure(inputs, diagnosis.where.unknown_inputs),
            f"Unknown input of each balance over time{which}: what the model without effects "
            "lacks, with a band of ±2σ and its size over the balance's signal. Balances share "
            "parameters and pressures: what one lacks shows in others too. Where the model "
            "is right the band covers zero, but for a narrow spike where the command jumps: the "
            "pressures are smoothed, the command is not. Grey: the axis sticks, and static "
            "friction balances any force.",
        )
    shares, labels = diagnosis.where.shares, gap_labels(diagnosis)
    named = {location.value for location in diagnosis.where.balances}
    for balance in sorted(shares, key=lambda name: (name not in named, -shares[name])):
        before = [regime for regime in evidence.before if regime.balance == balance]
        after = [regime for regime in evidence.after if regime.balance == balance]
        if before and (balance in named or shares[balance] >= SHARE):
            yield Drawn(
                f"regimes_{balance}",
                regime_figure(before, after, labels),
                f"Mean residual of the {plain(balance)} balance over the operating conditions, "
                f"with bands of ±2σ, {' and '.join(labels[: 2 if after else 1])}. "
                "A complete model gives a flat line at zero.",
            )


def _gap_words(diagnosis: Diagnosis) -> str:
    """Return the main numbers of the figure, for readers who cannot see it."""
    gap = diagnosis.gap
    after = f", {percent(gap.after)} after" if has_after(diagnosis) else ""
    term = "" if gap.with_term is None else f", {percent(gap.with_term)} with the discovered term"
    return f"Over all outputs: {percent(gap.before)}{' before' if after else ''}{after}{term}."


def _ranking_words(diagnosis: Diagnosis) -> str:
    first = diagnosis.ranking[0]
    removed = "" if first.closure is None else f", closes {whole(first.closure.value)}"
    return f"First: {plain(first.label)}, probability {chance(first.probability)}{removed}."
