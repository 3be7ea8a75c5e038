"""Tables of errors on held-out records."""

from collections.abc import Mapping

from pneumo_casadi.report.tables.table import DISPLAY, Table
from pneumo_casadi.validation import Error, Validation


def validation_table(validation: Validation) -> Table:
    """Return the errors on held-out records, in units and per cent, beside the sensor noise."""
    runs: list[tuple[str, Mapping[str, Error]]] = [
        (f"windows of {length:g} s", errors) for length, errors in validation.windows.items()
    ]
    runs.append(("open loop, whole record", validation.open_loop))
    if validation.closed_loop is not None:
        runs.append(("closed loop, whole record", validation.closed_loop))
    channels = list(validation.open_loop)
    units = [DISPLAY.get(validation.open_loop[c].unit, ("", 1.0))[0] for c in channels]
    rows = [
        (label, *(_error_text(errors[channel]) for channel in channels)) for label, errors in runs
    ]
    rows.append(("sensor noise", *(_noise_text(validation.open_loop[c]) for c in channels)))
    return Table(
        "Root-mean-square errors on held-out records (per cent of the signal's standard deviation)",
        ("", *(f"{c} [{u}]" for c, u in zip(channels, units, strict=True))),
        tuple(rows),
    )


def _error_text(error: Error) -> str:
    factor = DISPLAY.get(error.unit, ("", 1.0))[1]
    return f"{error.rms * factor:.3g} ({error.percent:.2g} %)"


def _noise_text(error: Error) -> str:
    if not error.noise_percent or not error.percent:
        return "unknown"
    factor = DISPLAY.get(error.unit, ("", 1.0))[1]
    return f"{error.noise * factor:.3g} ({error.noise_percent:.2g} %)"
