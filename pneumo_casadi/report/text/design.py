"""A designed experiment as text: predicted precision, parts of the reference, limits."""

import numpy as np

from pneumo_casadi.design import COMMON, KINDS, Design, Part, Precision
from pneumo_casadi.report.tables.quantities import DISPLAY_UNITS
from pneumo_casadi.report.tables.table import (
    Table,
    exponent_of,
    scaled_unit,
    value_text,
    with_symbols,
)
from pneumo_casadi.report.text.identification import render

UNITS = {"position": "m", "velocity": "m/s", "p_min": "Pa", "p_max": "Pa", "command": "V"}


def design_text(design: Design) -> str:
    """Return a design as text: predicted precision, parts of the reference, limits."""
    parts = [render(table) for table in design_tables(design)]
    return "\n\n\n".join([*parts, *(["\n".join(design.notes)] if design.notes else [])])


def design_tables(design: Design) -> tuple[Table, ...]:
    """Return the tables of a design: what is gained, parts of the reference, limits."""
    gained = (
        precision_table(design.precision)
        if design.precision is not None
        else distance_table(design)
    )
    return gained, parts_table(design), limits_table(design)


def precision_table(precision: Precision) -> Table:
    """Return predicted standard errors, in per cent of the values, and their ratio."""
    rows = []
    for i, name in enumerate(precision.names):
        value = precision.values[i]
        exponent = exponent_of(value)
        unit = scaled_unit(precision.units[i], exponent)
        columns = (precision.now[i], precision.designed[i], precision.together[i])
        percent = [_percent(std, value) for std in columns]
        rows.append(
            (
                with_symbols(name),
                value_text(value, exponent, 4),
                unit,
                *percent,
                f"{precision.ratio(name):.2f}",
            )
        )
    gain = precision.after / precision.before
    sizes = [f"{100 * size:.4f}" for size in (precision.before, precision.after, precision.both)]
    rows.append((f"criterion {precision.criterion.value}", "", "", *sizes, f"{gain:.2f}"))
    return Table(
        "Predicted standard errors [%]",
        ("", "value", "unit", "recorded", "designed", "both", "designed/recorded"),
        tuple(rows),
        (
            "From the noise of the sensors alone, 1σ: intervals of an identification are wider, as "
            "they contain the correlation of the residuals and the noise of the flow map. Compare "
            "the columns, do not quote them. Both: one fit to the two records together.",
        ),
    )


def _percent(std: float, value: float) -> str:
    if not np.isfinite(std):
        return "no information"
    return f"{100 * std / abs(value):.4f}" if value else ""


def distance_table(design: Design) -> Table:
    """Return refitted distances before and after."""
    rows = [
        (
            distance.truth,
            distance.fitted,
            f"{distance.before:.1f}",
            f"{distance.after:.1f}",
            _verdict(distance.hidden),
        )
        for distance in design.distances
    ]
    samples = design.distances[0].samples
    return Table(
        "Residual of one effect after the other is fitted to it [standard deviations]",
        ("true effect", "fitted effect", "recorded", "designed", ""),
        tuple(rows),
        (
            f"Noise alone gives √{samples} = {samples**0.5:.0f}. Half the square of a distance is "
            "the expected difference of the log-likelihoods.",
        ),
    )


def _verdict(hidden: bool) -> str:
    return "compensated by nominal parameters" if hidden else ""


def parts_table(design: Design) -> Table:
    """Return the parts of the reference."""
    begin, rows = 0.0, []
    for part in design.parts:
        whole = part.kind == COMMON
        length = design.reference.duration * (1.0 if whole else part.share)
        first = 0.0 if whole else begin
        rows.append((part.kind, f"{first:.1f} … {first + length:.1f}", _numbers(part)))
        begin += 0.0 if whole else length
    return Table("Parts of the reference", ("", "from … to [s]", "settings"), tuple(rows))


def _numbers(part: Part) -> str:
    return ", ".join(
        f"{number.name} {value:.3g}" + ("" if number.unit == "1" else f" {number.unit}")
        for number, value in zip(KINDS[part.kind].numbers, part.values, strict=True)
    )


def limits_table(design: Design) -> Table:
    """Return the extremes of the simulation beside the limits."""
    limits = design.options.limits
    rows = []
    for name, unit in UNITS.items():
        shown, factor = DISPLAY_UNITS.get(unit, (unit, 1.0))
        values = (design.extremes[name], getattr(limits, name))
        cells = (f"{factor * value:.4g}" for value in values)
        rows.append((name.replace("_", " "), shown, *cells))
    notes = (
        "Amplitudes are shares of the allowed position range, steps of the allowed common command.",
    )
    return Table(
        "Simulated extremes and limits", ("", "unit", "extreme", "limit"), tuple(rows), notes
    )
