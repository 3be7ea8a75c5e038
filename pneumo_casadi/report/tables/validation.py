"""Tables of errors on held-out records, and of what all records cover."""

from collections.abc import Mapping, Sequence
from typing import Any

from pneumo_casadi.report.tables.table import DISPLAY, Table
from pneumo_casadi.validation import Error, Validation

#: Symbols of the ranges, with unit and factor from SI.
_RANGES = {
    "x": ("mm", 1e3),
    "v": ("mm/s", 1e3),
    "p_P": ("kPa", 1e-3),
    "p_N": ("kPa", 1e-3),
    "F": ("N", 1.0),
}
_NOTE = (
    "The records held out test the model over their own ranges only. Velocities are differences of "
    "the position over 20 ms."
)

#: Sensor noise [% of the signal] below which differences of samples do not resolve it: that of a
#: fine encoder is less than a digit of the simulation.
RESOLVED = 1e-3


def validation_table(validation: Validation) -> Table:
    """Return the errors on held-out records, in units and per cent, beside the sensor noise."""
    runs: list[tuple[str, Mapping[str, Error]]] = [
        (f"windows of {length:g} s", errors) for length, errors in validation.windows.items()
    ]
    runs.append(("open loop, whole record", validation.open_loop))
    if validation.closed_loop is not None:
        runs.append(("closed loop, whole record", validation.closed_loop))
    channels = list(validation.open_loop)
    units = [_display(validation.open_loop[c].unit)[0] for c in channels]
    rows = [
        (label, *(_error_text(errors[channel]) for channel in channels)) for label, errors in runs
    ]
    rows.append(("sensor noise", *(_noise_text(validation.open_loop[c]) for c in channels)))
    return Table(
        "Root-mean-square errors on held-out records (per cent of the signal's standard deviation)",
        ("", *(f"{c} [{u}]" for c, u in zip(channels, units, strict=True))),
        tuple(rows),
    )


def _display(unit: str) -> tuple[str, float]:
    """Return the unit that is shown for one of SI, with the factor to it."""
    return DISPLAY.get(unit, (unit, 1.0))


def _error_text(error: Error) -> str:
    factor = _display(error.unit)[1]
    return f"{error.rms * factor:.3g} ({error.percent:.2g} %)"


def _noise_text(error: Error) -> str:
    if not error.noise_percent or not error.percent:
        return "unknown"
    if error.noise_percent < RESOLVED:
        return "not resolved"
    factor = _display(error.unit)[1]
    return f"{error.noise * factor:.3g} ({error.noise_percent:.2g} %)"


def records_table(provenance: Mapping[str, Any]) -> Table:
    """Return what each record was used for, its length and rate, and the ranges of its channels.

    Parameters
    ----------
    provenance : mapping
        Of a result; one that names no records gives an empty table.
    """
    records: Sequence[Mapping[str, Any]] = provenance.get("records", ())
    shown = [name for name in _RANGES if any(name in each["ranges"] for each in records)]
    headings = [f"{name} [{_RANGES[name][0]}]" for name in shown]
    rows = tuple(
        (
            each["name"],
            each["use"],
            f"{each['duration']:.4g} s",
            f"{each['rate']:.5g} Hz",
            *(_range(each["ranges"].get(name), _RANGES[name][1]) for name in shown),
        )
        for each in records
    )
    columns = ("record", "used", "duration", "sampling", *headings)
    return Table("Records and the ranges that they cover", columns, rows, (_NOTE,))


def _range(ends: Sequence[float] | None, factor: float) -> str:
    if ends is None:
        return "not recorded"
    low, high = (_short(end * factor) for end in ends)
    return f"{low} to {high}"


def _short(value: float) -> str:
    """Return three digits and a true minus sign."""
    return f"{value:.3g}".replace("-", "\N{MINUS SIGN}")
