"""The figures of a diagnosis: gap, ranking, location; curves where there are any."""

from collections.abc import Iterator, Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pneumo_casadi.diagnosis import Candidate, Diagnosis
from pneumo_casadi.diagnosis.evidence import Evidence
from pneumo_casadi.report.diagnosis_tables import (
    VIEWS,
    chance,
    has_after,
    percent,
    plain,
    whole,
    with_what,
)
from pneumo_casadi.report.figures import Drawn
from pneumo_casadi.report.figures.regimes import regime_figure
from pneumo_casadi.report.figures.style import (
    BLACK,
    BLUE,
    GREY,
    HEAD,
    ORANGE,
    SMALL,
    SYMBOLS,
    TEXT,
    VERMILION,
    dress,
    legend_above,
    new_figure,
)
from pneumo_casadi.report.figures.unknown_inputs import unknown_input_figure

#: Without effects, with them.
BEFORE, AFTER = ORANGE, BLUE
#: Height of a bar's row, and of what an axis needs beside its rows [mm].
ROW, REST = 5.4, 11.0
#: Candidates drawn.
DRAWN = 8
#: A balance is drawn in detail from this share of what all lack.
SHARE = 0.1


def diagnosis_figures(found: Diagnosis) -> Iterator[Drawn]:
    """Draw all figures of a diagnosis, in order; curves where it carries its evidence."""
    if found.gap.views:
        yield Drawn(
            "gap",
            gap_figure(found),
            "Gap on held-out data without effects and with those found, in per cent of each "
            "signal, beyond the noise of the sensors; the black mark is that noise. "
            + _gap_words(found),
        )
    if any(one.shrink is not None or one.probability > 0 for one in found.ranking):
        yield Drawn(
            "ranking",
            ranking_figure(found),
            "The most probable causes, and how much of the held-out gap in the balances each one "
            "closes, with its 95 % interval. " + _ranking_words(found),
        )
    if any(found.where.shares.values()) or found.where.regimes:
        yield Drawn(
            "where",
            where_figure(found),
            "Share of each balance in what the model without effects lacks; below, the parts of "
            "the record that hold more of the gap than of the time (of a frequency band: than of "
            "the signal).",
        )
    if found.evidence is not None:
        yield from _curves(found, found.evidence)


def _curves(found: Diagnosis, evidence: Evidence) -> Iterator[Drawn]:
    several = len(evidence.inputs) > 1
    for i, inputs in enumerate(evidence.inputs, 1):
        which = f", held-out record {i}" if several else ""
        yield Drawn(
            f"unknown_inputs_{i}" if several else "unknown_inputs",
            unknown_input_figure(inputs, found.where.shares),
            f"What the balances lack over time{which}: the unknown input of each, with a band of "
            "±2σ. Where the model is right the band covers zero. Grey: the axis sticks, and "
            "friction takes any force.",
        )
    shares = found.where.shares
    for balance in sorted(shares, key=lambda name: -shares[name]):
        before = [one for one in evidence.before if one.balance == balance]
        after = [one for one in evidence.after if one.balance == balance]
        if before and shares[balance] >= SHARE:
            yield Drawn(
                f"regimes_{balance}",
                regime_figure(before, after),
                f"Mean residual of the {plain(balance)} balance over what went on, with bands of "
                "±2σ, without effects"
                + (" and with those found." if after else ".")
                + " A flat line at zero is a complete model.",
            )


def gap_figure(found: Diagnosis) -> Figure:
    """Draw the gap before and after, one panel a view."""
    views = [name for name in (*VIEWS, *found.gap.views) if name in found.gap.views]
    views = list(dict.fromkeys(views))
    counts = [len(found.gap.views[name]) for name in views]
    height = sum(ROW * 1.4 * n + REST + 2 for n in counts) + HEAD
    figure = new_figure(height, head=HEAD)
    panels = figure.subplots(len(views), 1, squeeze=False, height_ratios=counts)[:, 0]
    for axes, view in zip(panels, views, strict=True):
        _gap_panel(axes, view, found.gap.views[view], _labels(found))
    legend_above(panels[0], 3)
    return figure


def _gap_panel(
    axes: Axes, view: str, outputs: Mapping[str, Mapping[str, float]], labels: list[str]
) -> None:
    y = np.arange(len(outputs), dtype=float)
    both = len(labels) == 2
    kinds = [("before", BEFORE, -0.2), ("after", AFTER, 0.2)]
    thick = 0.36 if both else 0.6
    noise = [one["noise"] for one in outputs.values()]
    largest = max(max(one["before"], one["after"], one["noise"]) for one in outputs.values())
    for label, (key, colour, shift) in zip(labels, kinds, strict=False):
        at = y + (shift if both else 0.0)
        values = [one[key] for one in outputs.values()]
        axes.barh(at, values, thick, color=colour, label=label, zorder=2)
        for place, value, mark in zip(at, values, noise, strict=True):
            # Beyond the mark where the number would stand on it.
            end = mark if value <= mark < value + 0.13 * largest else value
            axes.annotate(
                percent(value).removesuffix(" %"), (end, place), (2, -0.4),
                textcoords="offset points", va="center", fontsize=SMALL - 1.0, zorder=4,
            )  # fmt: skip
    axes.vlines(noise, y - 0.42, y + 0.42, color=BLACK, linewidth=1.2, label="noise", zorder=3)
    names = [SYMBOLS.get(name, name) for name in outputs]
    dress(axes, f"{VIEWS.get(view, plain(view))} [%]")
    axes.set_yticks(y, names, fontsize=TEXT)
    axes.set_ylim(len(outputs) - 0.45, -0.55)
    axes.set_xlim(0, 1.14 * largest if largest > 0 else 1.0)
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)


def _labels(found: Diagnosis) -> list[str]:
    """Name the bars: without effects, and with effects where that was simulated."""
    return ["without effects", *([with_what(found)] if has_after(found) else [])]


def ranking_figure(found: Diagnosis) -> Figure:
    """Draw the first candidates: probability, and the share of the gap that each closes."""
    shown = [one for one in found.ranking if not one.failure][:DRAWN]
    figure = new_figure(ROW * len(shown) + REST + 2)
    left, right = figure.subplots(1, 2, sharey=True)
    y = np.arange(len(shown))
    named = {one.name for one in found.effects}
    for i, one in enumerate(shown):
        colour = BLUE if set(one.names) == named else GREY
        left.barh(i, 100 * one.probability, 0.62, color=colour, zorder=2)
        _closing(right, i, one, colour)
    labels = [_lines(one.label) for one in shown]
    dress(left, "probability [%]")
    dress(right, "gap closed [%]")
    left.set_xlim(0, 104)
    low = min((100 * one.shrink.lower for one in shown if one.shrink is not None), default=0.0)
    right.set_xlim(max(min(low - 4, -4), -104), 104)
    right.axvline(0, color=BLACK, linewidth=0.6, zorder=1)
    left.set_yticks(y, labels, fontsize=SMALL)
    left.set_ylim(len(shown) - 0.45, -0.55)
    for axes in (left, right):
        axes.grid(False, axis="y")
        axes.tick_params(axis="y", length=0)
    return figure


def _closing(axes: Axes, i: int, one: Candidate, colour: str) -> None:
    if one.shrink is None:
        axes.text(2, i, "not fitted", fontsize=SMALL - 0.5, va="center", color=BLACK)
        return
    value, low, high = (
        100 * part for part in (one.shrink.value, one.shrink.lower, one.shrink.upper)
    )
    axes.hlines(i, low, high, color=colour, linewidth=2.4, zorder=2)
    axes.plot(value, i, "o", color=BLACK, markersize=2.6, zorder=3, clip_on=False)


def _lines(label: str) -> str:
    return plain(label).replace(" + ", " +\n")


def where_figure(found: Diagnosis) -> Figure:
    """Draw the share of each balance, and regimes with their shares of gap and time."""
    shares, regimes = found.where.shares, found.where.regimes
    heights = [ROW * len(shares) + REST]
    if regimes:
        heights.append(ROW * 2.2 * len(regimes) + REST)
    figure = new_figure(sum(heights))
    panels = figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    _bars(panels[0], [SYMBOLS.get(name, name) for name in shares], list(shares.values()))
    panels[0].set_xlabel("share of what the balances lack [%]", fontsize=TEXT, labelpad=2)
    if regimes:
        below = panels[1]
        y = np.arange(len(regimes), dtype=float)
        share, time = ([100 * getattr(one, key) for one in regimes] for key in ("share", "time"))
        below.barh(y + 0.02, share, 0.22, color=VERMILION, label="of the gap", zorder=2)
        below.barh(y + 0.26, time, 0.22, color=GREY, label="of the time", zorder=2)
        for i, one in enumerate(regimes):
            # Names are too long to stand beside the bars in a column.
            text = f"{one.name}, {SYMBOLS.get(one.balance, one.balance)}"
            below.text(0.6, i - 0.26, text, fontsize=SMALL, va="center", zorder=3)
        dress(below, "share [%]")
        below.set_yticks([])
        below.set_ylim(len(regimes) - 0.5, -0.55)
        below.set_xlim(0, 104)
        below.grid(False, axis="y")
        legend_above(below, 2)
        below.get_legend().set_in_layout(True)  # there is another panel above it
    return figure


def _bars(axes: Axes, names: list[str], shares: list[float]) -> None:
    y = np.arange(len(names))
    values = [100 * one for one in shares]
    axes.barh(y, values, 0.6, color=BLUE, zorder=2)
    for i, value in enumerate(values):
        inside = value > 85
        axes.annotate(
            percent(value), (value, i), (-2 if inside else 2, -0.4), textcoords="offset points",
            va="center", ha="right" if inside else "left", fontsize=SMALL - 0.5,
            color="#ffffff" if inside else BLACK, zorder=4,
        )  # fmt: skip
    dress(axes)
    axes.set_yticks(y, names, fontsize=TEXT)
    axes.set_ylim(len(names) - 0.45, -0.55)
    axes.set_xlim(0, 104)
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)


def _gap_words(found: Diagnosis) -> str:
    """Say the figure's main numbers, for those who do not see it."""
    gap = found.gap
    if not has_after(found):
        return f"Over all outputs: {percent(gap.before)}."
    return f"Over all outputs: {percent(gap.before)} before, {percent(gap.after)} after."


def _ranking_words(found: Diagnosis) -> str:
    first = found.ranking[0]
    closes = "" if first.shrink is None else f", closes {whole(first.shrink.value)}"
    return f"First: {plain(first.label)}, probability {chance(first.probability)}{closes}."
