"""Tables of a comparison of results."""

from math import isfinite

from pneumo_casadi.identification.compared_model import Estimate
from pneumo_casadi.identification.comparison import (
    MOVED,
    Comparison,
    Difference,
)
from pneumo_casadi.report.tables.quantities import percent
from pneumo_casadi.report.tables.table import (
    DISPLAY,
    Table,
    exponent_of,
    interval_text,
    scaled_unit,
    with_symbols,
)


def comparison_tables(comparison: Comparison) -> tuple[Table, ...]:
    """Return the estimates side by side, and every result's simulation of every record."""
    simulated = (_simulation_table(comparison),) if comparison.simulations else ()
    return (_parameter_table(comparison), *simulated)


def _parameter_table(comparison: Comparison) -> Table:
    differences = {(item.name, item.other): item for item in comparison.differences}
    others = comparison.names[1:]
    rows = []
    for name, estimates in comparison.estimates.items():
        known = [item for item in estimates if item is not None]
        e = exponent_of(known[0].value)
        rows.append(
            (
                with_symbols(name),
                scaled_unit("" if known[0].unit == "1" else known[0].unit, e),
                *(_estimate_text(item, e) for item in estimates),
                *(_difference_text(differences.get((name, other))) for other in others),
            )
        )
    headings = ["difference"] if len(others) == 1 else [f"{name} - first" for name in others]
    return Table(
        "Estimates ± 2σ",
        ("", "unit", *comparison.names, *headings),
        tuple(rows),
        (f"σ: of the difference, robust; * marks more than {MOVED:g} σ.", *comparison.notes),
    )


def _estimate_text(item: Estimate | None, exponent: int) -> str:
    if item is None:
        return ""
    if item.std == 0:
        return f"{item.value / 10.0**exponent:.4g} (held)"
    return interval_text(item.value, 2 * item.std, exponent)


def _difference_text(item: Difference | None) -> str:
    if item is None:
        return ""
    # No minus before a change that is rounded to zero.
    percents = round(item.change_percent, 2) + 0.0 if isfinite(item.change_percent) else None
    change = "from 0" if percents is None else f"{percents:+.2f} %"
    if item.sigmas is None:
        return change
    return f"{change} ({round(item.sigmas, 1) + 0.0:+.1f} σ){' *' if item.moved else ''}"


def _simulation_table(comparison: Comparison) -> Table:
    first = comparison.simulations[0].errors
    units = {name: DISPLAY.get(error.unit, (error.unit, 1.0)) for name, error in first.items()}
    rows = [
        (
            item.records,
            item.parameters,
            *(
                f"{error.rms * units[name][1]:.3g} ({percent(error.gap_percent)})"
                for name, error in item.errors.items()
            ),
        )
        for item in comparison.simulations
    ]
    return Table(
        "Error of the simulation over windows of up to 2 s (gap beyond the sensor noise, in per "
        "cent of the signal)",
        ("records of", "parameters of", *(f"{name} [{unit}]" for name, (unit, _) in units.items())),
        tuple(rows),
    )
