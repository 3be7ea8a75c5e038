"""The tables of a diagnosis."""

import math
from collections.abc import Iterator, Mapping

from pneumo_casadi.diagnosis import Candidate, Closure, Diagnosis, Value
from pneumo_casadi.report.tables.flow_form import flow_form_tables
from pneumo_casadi.report.tables.results import Table, exponent_of, interval_text

#: Places in words.
BALANCES = {
    "mass_flow_P": "mass flow into chamber P",
    "mass_flow_N": "mass flow into chamber N",
    "force": "force on the piston",
    "measurement": "what a sensor shows",
    "none": "nowhere",
}
#: Ways of looking at the gap, in the order in which they are shown.
VIEWS = {
    "windows": "open loop, windows of 0.5 s",
    "closed_loop": "closed loop",
    "balances": "balances along the measured motion",
}
#: Units in which people read, with the factor from SI.
READ = {
    "m": ("mm", 1e3),
    "m/s": ("mm/s", 1e3),
    "m2": ("cm²", 1e4),
    "s": ("ms", 1e3),
    "Pa": ("kPa", 1e-3),
    "kg/s": ("g/s", 1e3),
    "m³/(s Pa)": ("l/(s bar)", 1e8),
    "N s2/m2": ("N s²/m²", 1.0),
    "1": ("", 1.0),
}
#: Candidates shown; the JSON file has them all.
SHOWN = 12
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


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
    """Return the held-out gap by view and output, before and after."""
    rows = [
        (
            f"{VIEWS.get(view, plain(view))}: {_short(name)}",
            *(percent(values[key]) for key in ("before", "after")),
            _closed(values["before"], values["after"]),
            percent(values["noise"]),
        )
        for view, name, values in gap_rows(diagnosis)
    ]
    table = Table(
        "Gap on held-out data, in % of the signal",
        ("", "without effects", with_what(diagnosis), "closed", "noise"),
        tuple(rows),
        ("What the sensors' noise alone leaves is taken off.",),
    )
    return table if has_after(diagnosis) else table.without(with_what(diagnosis), "closed")


def has_after(diagnosis: Diagnosis) -> bool:
    """Whether the gap was simulated with effects too."""
    return bool(diagnosis.effects) or diagnosis.gap.after != diagnosis.gap.before


def nearest(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Name the effects of the model that came nearest where none is the cause."""
    new = [name.partition(".")[0] for name in diagnosis.fitted if name not in diagnosis.nominal]
    return tuple(dict.fromkeys(new))


def with_what(diagnosis: Diagnosis) -> str:
    """Return what the model with effects is called."""
    if diagnosis.effects:
        return "with it" if len(diagnosis.effects) == 1 else "with them"
    return "with the nearest"


def gap_rows(diagnosis: Diagnosis) -> Iterator[tuple[str, str, Mapping[str, float]]]:
    """Yield view, output or balance, and its gap, in the order in which they are shown."""
    views = diagnosis.gap.views
    for view in (*VIEWS, *(name for name in views if name not in VIEWS)):
        for name, values in views.get(view, {}).items():
            yield view, name, values


def regime_table(diagnosis: Diagnosis) -> Table:
    """Return the regimes in which the gap is larger than elsewhere."""
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
        "Where in the record the gap is found",
        ("regime", "balance", "of the gap", "of the time", "ratio", "p"),
        tuple(rows),
        (
            "Of a frequency band, for the time: its share of the balance's own signal.",
            "p: chance of such a share with the residuals shuffled in blocks.",
        ),
    )


def ranking_table(diagnosis: Diagnosis) -> Table:
    """Return the most probable candidates, and those whose fit failed."""
    first = [candidate for candidate in diagnosis.ranking if not candidate.failure]
    failed = [candidate for candidate in diagnosis.ranking if candidate.failure]
    rows = [
        (
            plain(candidate.label),
            chance(candidate.probability),
            *_shrink(candidate),
            whole(candidate.explained),
            whole(candidate.observable),
        )
        for candidate in (*first[:SHOWN], *failed)
    ]
    left = len(first) - len(first[:SHOWN])
    return Table(
        "Candidates",
        ("", "probability", "closes", "95 % interval", "promised", "observable"),
        tuple(rows),
        (
            "Closes: of the held-out gap in the balances.",
            "Promised: of the squared residuals, by the screen before any refit.",
            "Observable: share of its influence that a refit without it does not take up.",
            *((f"{left} more are in diagnosis.json.",) if left else ()),
        ),
    )


def _shrink(candidate: Candidate) -> tuple[str, str]:
    if candidate.failure:
        return "fit failed", ""
    if candidate.closure is None:
        return "not fitted", ""
    return whole(candidate.closure.value), between(candidate.closure)


def check_table(diagnosis: Diagnosis) -> Table:
    """Return the parameters beside what geometry and data sheet say of them."""
    rows = []
    for check in diagnosis.checks:
        unit, factor = READ.get(check.unit, (check.unit, 1.0))
        value = Value(check.value * factor, check.std * factor, "")
        expected, tolerance = check.expected * factor, check.tolerance * factor
        rows.append(
            (
                check.name,
                unit,
                quantity(value, held=""),
                f"{expected:.4g} ± {tolerance:.2g}",
                "yes" if check.agrees else "NO",
            )
        )
    return Table(
        "Parameters against geometry and data sheet",
        ("", "unit", "found ± 2σ", "expected", "agrees"),
        tuple(rows),
    )


def fitted_table(diagnosis: Diagnosis) -> Table:
    """Return all parameters without and with the effects found."""
    names = list(dict.fromkeys([*diagnosis.fitted, *diagnosis.nominal]))
    both = [(name, diagnosis.nominal.get(name), diagnosis.fitted.get(name)) for name in names]
    rows = [
        (name, (without or with_ or Value(0.0, 0.0, "")).unit, *map(_cell, (without, with_)))
        for name, without, with_ in both
    ]
    title = "Fitted parameters ± 2σ"
    if not has_after(diagnosis):
        return Table(title, ("", "unit", "found"), tuple(row[:3] for row in rows))
    return Table(title, ("", "unit", "without effects", with_what(diagnosis)), tuple(rows))


def _cell(value: Value | None) -> str:
    return "" if value is None else quantity(Value(value.value, value.std, ""))


def quantity(value: Value, held: str = " (not fitted)") -> str:
    """Return a value ± 2σ in a unit that people read.

    Parameters
    ----------
    value : Value
        In SI units.
    held : str, optional
        What is added to a value that has no standard deviation.

    Examples
    --------
    >>> quantity(Value(0.0213, 0.0004, "m/s"))
    '21.30 ± 0.80 mm/s'
    >>> quantity(Value(3.49e-9, 0.0, "kg/Pa"))
    '3.490·10⁻⁹ kg/Pa (not fitted)'
    """
    unit, factor = READ.get(value.unit, (value.unit, 1.0))
    size, half = value.value * factor, 2 * value.std * factor
    exponent = exponent_of(size)
    text = interval_text(size, math.inf if math.isnan(half) else half or None, exponent)
    if exponent:
        power = f"·10{str(exponent).translate(_SUPERSCRIPTS)}"
        text = f"({text}){power}" if half else f"{text}{power}"
    return f"{text} {unit}".rstrip() + ("" if half else held)


def percent(value: float) -> str:
    """Return per cent with as many digits as one reads.

    Examples
    --------
    >>> percent(0.0011), percent(3.14), percent(31.4), percent(314.0), percent(1e-7)
    ('0.0011 %', '3.1 %', '31 %', '314 %', '0 %')
    """
    return f"{value:.0f} %" if abs(value) >= 9.95 else f"{_small(value)} %"


def _small(value: float) -> str:
    return "0" if abs(value) < 5e-5 else f"{value:#.2g}"


def chance(probability: float) -> str:
    """Return a probability in whole per cent; what rounds to never or always is no such thing.

    Examples
    --------
    >>> chance(0.974), chance(1e-9), chance(0.9999)
    ('97 %', '< 1 %', '> 99 %')
    """
    if probability < 0.01:
        return "< 1 %"
    return "> 99 %" if probability > 0.99 else f"{100 * probability:.0f} %"


def between(closure: Closure) -> str:
    """Return the interval of a shrink in whole per cent.

    Examples
    --------
    >>> between(Closure(0.9, 0.874, 0.926))
    '87 to 93 %'
    """
    return f"{whole(closure.lower).removesuffix(' %')} to {whole(closure.upper)}"


def whole(share: float) -> str:
    """Return a share in whole per cent.

    Examples
    --------
    >>> whole(-0.001)
    '0 %'
    """
    return f"{round(100 * share)} %"


def plain(name: str) -> str:
    """Return a name of the catalogue, or several, without underscores.

    Examples
    --------
    >>> plain("leakage_P + valve_dead_zone")
    'leakage P + valve dead zone'
    """
    return name.replace("_", " ")


def _short(name: str) -> str:
    return {"mass_flow_P": "flow P", "mass_flow_N": "flow N"}.get(name, name)


def _closed(before: float, after: float) -> str:
    return "" if before <= 0 else whole(1 - after / before)
