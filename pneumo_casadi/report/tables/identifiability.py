"""Tables of uncertainty: what the data fix, what fixes it, and intervals side by side."""

import math
from collections.abc import Mapping, Sequence

from pneumo_casadi.estimation.output_error import OutputErrorResult
from pneumo_casadi.estimation.statistics import interval_factor
from pneumo_casadi.estimation.uncertainty import Bootstrap, Direction, Identifiability, Profile
from pneumo_casadi.report.tables.table import (
    Table,
    exponent_of,
    scaled_unit,
    value_text,
    with_symbols,
)

#: Parts of a direction, and collinear groups, that are printed.
PARTS, GROUPS = 6, 10


def identifiability_tables(identifiability: Identifiability) -> tuple[Table, ...]:
    """Return the tables of identifiability.

    Parameters
    ----------
    identifiability : Identifiability
        From `identifiability`.

    Returns
    -------
    tuple of Table
        Parameters with the sources of their information; the least certain combinations; groups
        of parameters that compensate each other.
    """
    return (
        _parameter_table(identifiability),
        _direction_table(identifiability),
        _group_table(identifiability),
    )


def _parameter_table(identifiability: Identifiability) -> Table:
    rows = []
    for j, name in enumerate(identifiability.names):
        relative = float(identifiability.std[j] / identifiability.sizes[j])
        why = "at its bound" if name in identifiability.at_bound else "no information"
        rows.append(
            (
                with_symbols(name),
                _percent(relative) if math.isfinite(relative) else f"∞ ({why})",
                *(_source(identifiability, i, j) for i in range(len(identifiability.sources))),
            )
        )
    return Table(
        "Sources of information on each parameter",
        ("", "relative std", *identifiability.sources),
        tuple(rows),
        (
            "Per source: its share of the information on the parameter, all others known; in",
            "brackets the factor by which the standard deviation grows without the source, all",
            "others estimated.",
        ),
    )


def _source(identifiability: Identifiability, i: int, j: int) -> str:
    growth = _factor(identifiability.std_without[i, j])
    return f"{100 * identifiability.share[i, j]:.0f} % (×{growth})"


def _direction_table(identifiability: Identifiability) -> Table:
    weak = identifiability.weak()
    shown: Sequence[Direction] = weak or identifiability.directions[-3:][::-1]
    rows = tuple((_combination(d.weights), _percent(d.relative_std)) for d in shown)
    title = (
        "Parameter combinations with a relative standard deviation above 10 %"
        if weak
        else "Least certain parameter combinations"
    )
    return Table(
        title,
        ("combination of relative parameters", "std"),
        rows,
        (f"Condition number of the scaled sensitivities: {identifiability.condition:.3g}.",),
    )


def _group_table(identifiability: Identifiability) -> Table:
    rows = [
        (_symbols(group.names), "collinear", f"γ = {group.index:.3g}")
        for group in identifiability.collinear[:GROUPS]
    ]
    left = len(identifiability.collinear) - GROUPS
    if left > 0:
        rows.append((f"and {left} further groups", "collinear", ""))
    rows += [
        (_symbols(cluster), "correlated", "|ρ| > 0.95") for cluster in identifiability.clusters
    ]
    return Table(
        "Parameters that compensate each other",
        ("parameters", "relation", "measure"),
        tuple(rows) or (("none", "", ""),),
        ("γ: collinearity index (Brun, Reichert and Künsch 2001); 5 to 20 is critical.",),
    )


def interval_table(
    result: OutputErrorResult,
    profiles: Mapping[str, Profile],
    bootstrap: Bootstrap | None = None,
    level: float = 0.95,
) -> Table:
    """Return intervals of the same quantities side by side.

    Parameters
    ----------
    result : OutputErrorResult
        Its Gauss-Newton and robust intervals.
    profiles : mapping of str to Profile
        The quantities shown: one row each.
    bootstrap : Bootstrap, optional
        Its percentile intervals.
    level : float, optional
        Of all of them.
    """
    rows = []
    for name, profile in profiles.items():
        e = exponent_of(profile.estimate)
        decimals = _decimals(interval_factor(level) * profile.std, e)
        pairs = [
            profile.gauss_newton(level),
            profile.gauss_newton(level, robust=True),
            profile.interval(level),
            profile.interval(level, robust=True),
        ]
        if bootstrap is not None:
            pairs.append(bootstrap.interval(name, level))
        unit = "" if profile.unit == "1" else profile.unit
        value = value_text(profile.estimate, e, decimals)
        rows.append(
            (
                with_symbols(name),
                scaled_unit(unit, e),
                value,
                *(_pair(pair, e, decimals) for pair in pairs),
            )
        )
    columns = ["", "unit", "estimate", "Gauss-Newton", "robust", "profile", "profile, robust"]
    return Table(
        f"Intervals at {100 * level:g} %",
        (*columns, *(["bootstrap"] if bootstrap is not None else [])),
        tuple(rows),
        (
            "Robust: includes the correlation of the residuals. ∞: the profile does not reach the "
            "threshold.",
        ),
    )


def _symbols(names: Sequence[str]) -> str:
    return ", ".join(map(with_symbols, names))


def _decimals(half: float, exponent: int) -> int:
    """Return the decimals that show two digits of half an interval."""
    if not (math.isfinite(half) and half > 0):
        return 3
    return min(max(1 - math.floor(math.log10(half / 10.0**exponent)), 0), 8)


def _pair(pair: tuple[float, float], exponent: int, decimals: int) -> str:
    texts = [
        value_text(value, exponent, decimals) if math.isfinite(value) else f"{value:+}"[0] + "∞"
        for value in pair
    ]
    return f"[{texts[0]}, {texts[1]}]"


def _combination(weights: Mapping[str, float]) -> str:
    """Write a direction with its largest parts.

    Examples
    --------
    >>> _combination({"X_s1": 0.8, "X_s2": -0.6})
    '+0.80 X_s1 -0.60 X_s2'
    """
    parts = [f"{weight:+.2f} {with_symbols(name)}" for name, weight in weights.items()]
    return " ".join(parts[:PARTS]) + (f" and {len(parts) - PARTS} more" * (len(parts) > PARTS))


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if math.isfinite(share) else "∞"


def _factor(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "∞"
