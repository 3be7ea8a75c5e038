"""Tables of results: estimates side by side, errors on held-out records."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pneumo_casadi.data import Bench
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.flow_anchor import flow_scale_std
from pneumo_casadi.estimation.wls import ratios
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.report.tables.paper import TABLE_1
from pneumo_casadi.validation import Error, Validation

#: SI unit -> unit of display and factor.
DISPLAY = {"m": ("mm", 1e3), "Pa": ("kPa", 1e-3)}


SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
#: What Table 1 is, below the tables that show it.
PAPER = (
    'Table 1: estimates ± 2σ of "Identification of physical parameters of a pneumatic '
    'servosystem" (IFAC 2005), on the bench of its authors.'
)
_SYMBOLS = {
    "F_c_plus": "F_c⁺",
    "F_c_minus": "F_c⁻",
    "psi_plus": "ψ⁺",
    "psi_minus": "ψ⁻",
    "phi": "φ",
}


@dataclass(frozen=True, slots=True)
class Table:
    """A table of text cells.

    Parameters
    ----------
    title : str
        What it shows.
    columns : tuple of str
        Headings; the first column is left-aligned, the others right.
    rows : tuple of tuple of str
        Cells.
    notes : tuple of str
        Lines below.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()

    @property
    def widths(self) -> tuple[int, ...]:
        """Width of each column in characters."""
        cells = zip(self.columns, *self.rows, strict=True)
        return tuple(max(map(len, column)) for column in cells)

    def without(self, *names: str) -> "Table":
        """Return the table without the named columns."""
        keep = [i for i, name in enumerate(self.columns) if name not in names]
        rows = tuple(tuple(row[i] for i in keep) for row in self.rows)
        return Table(self.title, tuple(self.columns[i] for i in keep), rows, self.notes)


def exponent_of(value: float) -> int:
    """Return the power of ten, a multiple of three, that is taken out of a value.

    Values from 0.01 to 9999 are read as they are.

    Examples
    --------
    >>> exponent_of(3.49e-9), exponent_of(16.9), exponent_of(0.0)
    (-9, 0, 0)
    """
    if value == 0 or 1e-2 <= abs(value) < 1e4:
        return 0
    return 3 * math.floor(math.log10(abs(value)) / 3)


def value_text(value: float, exponent: int = 0, decimals: int = 3) -> str:
    """Return a value divided by a power of ten.

    Examples
    --------
    >>> value_text(3.4879e-9, -9)
    '3.488'
    """
    return f"{value / 10.0**exponent:.{decimals}f}"


def interval_text(value: float, half: float | None, exponent: int = 0) -> str:
    """Return ``value ± half`` with two significant digits in the half width.

    Parameters
    ----------
    value : float
        Estimate.
    half : float or None
        Half width of the interval; infinite without information, None where there is none.

    Examples
    --------
    >>> interval_text(3.4879e-9, 3.01e-12, -9)
    '3.4879 ± 0.0030'
    >>> interval_text(16.9, float("inf"))
    '16.900 ± ∞'
    """
    if half is None or not math.isfinite(half) or half == 0:
        tail = "" if half is None else " ± 0" if half == 0 else " ± ∞"
        return value_text(value, exponent) + tail
    scaled = half / 10.0**exponent
    decimals = min(max(1 - math.floor(math.log10(scaled)), 0), 6)
    return f"{value_text(value, exponent, decimals)} ± {scaled:.{decimals}f}"


def with_symbols(text: str) -> str:
    """Return a text with the names of parameters as symbols of the equations.

    Examples
    --------
    >>> with_symbols("F_c_plus"), with_symbols("psi_minus_2"), with_symbols("M")
    ('F_c⁺', 'ψ⁻_2', 'M')
    """
    for plain, symbol in _SYMBOLS.items():
        text = re.sub(rf"\b{plain}(?=\b|_\d)", symbol, text)
    return text


def scaled_unit(unit: str, exponent: int) -> str:
    """Return a unit with the power of ten that was taken out of its values.

    Examples
    --------
    >>> scaled_unit("kg/Pa", -9), scaled_unit("kg", 0)
    ('10⁻⁹ kg/Pa', 'kg')
    """
    return unit if exponent == 0 else f"10{str(exponent).translate(SUPERSCRIPTS)} {unit}".rstrip()


def parameter_table(identification: Identification, paper: bool = False) -> Table:
    """Return WLS, output error, the truth if known, and on request Table 1 of the paper.

    Parameters
    ----------
    identification : Identification
        The identification.
    paper : bool, optional
        Whether to add Table 1 of the paper.

    Returns
    -------
    Table
        One row a parameter, values ± 2σ with a common power of ten taken out; below them the
        polytropic coefficients.
    """
    truth = dict(identification.truth or {})
    rows = []
    for name in identification.parameter_names:
        item = identification.output_error.parameters[name]
        wls = wls_estimate(identification, name)
        oe = (item.value, output_error_half_width(identification, name))
        held = name not in identification.output_error.uncertainty.names
        rows.append(_row(name, item.unit, wls, oe, truth, paper, held))
    for name in ("k_P", "k_N"):
        if name in identification.output_error.derived:
            rows.append(_derived_row(identification, name, truth, paper))
    columns = ["", "unit", "WLS", "output error", "truth", "OE - truth", "Table 1"]
    table = Table(
        "Identified parameters, estimate ± 2σ",
        tuple(columns),
        tuple(rows),
        (
            "2σ includes the correlation of the residuals and the bias of the smoothed friction, "
            "not the bias of an incomplete model.",
            *scale_notes(identification),
            *((PAPER,) if paper else ()),
        ),
    )
    absent = [] if truth else ["truth", "OE - truth"]
    return table.without(*absent, *([] if paper else ["Table 1"]))


def scale_notes(identification: Identification) -> tuple[str, ...]:
    """Return on which source the scale of X_s1 ... X_s6 rests, and how well that is known."""
    bench = identification.case.bench
    if not isinstance(bench, Bench):
        return ()
    if not bench.valves.metered:
        return (
            "No valve was metered: X_s1 ... X_s6 have the scale of the piston areas in bench.json, "
            f"known to {100 * bench.area_accuracy:.2g} % (1σ, in 2σ above); M and friction rest "
            "on the areas, the pressures and the motion, not on the valve.",
        )
    accuracy = 100 * flow_scale_std(bench)
    if accuracy > 0:
        return (
            "X_s1 ... X_s6 have the scale of the flow meter, whose stated accuracy of "
            f"{accuracy:.2g} % (1σ) is in 2σ.",
        )
    return (
        "The accuracy of the flow meter is not stated (valve.accuracy_percent in bench.json), and "
        "not in 2σ: a map metered 1 % too high makes X_s1 ... X_s6 1 % too large.",
    )


def wls_estimate(identification: Identification, name: str) -> tuple[float, float] | None:
    """Return a WLS estimate and its 2σ; None where WLS does not estimate the parameter."""
    if name not in identification.wls.names:
        return None
    at = identification.wls.names.index(name)
    return float(identification.wls.estimate[at]), wls_half_width(identification, name)


def wls_half_width(identification: Identification, name: str) -> float:
    """Return 2σ of a WLS estimate: the wider of eq. 16 and HAC."""
    at = identification.wls.names.index(name)
    return 2 * max(float(identification.wls.std[at]), float(identification.wls.std_hac[at]))


def output_error_half_width(identification: Identification, name: str) -> float | None:
    """Return 2σ of an output-error estimate, the wider of ideal and robust; None without one."""
    result = identification.output_error
    if name not in result.uncertainty.names or name in result.uncertainty.at_bound:
        return None
    return 2 * max(result.std(name), result.std(name, robust=True))


def _row(
    name: str,
    unit: str,
    wls: tuple[float, float] | None,
    output_error: tuple[float, float | None],
    truth: Mapping[str, float],
    paper: bool,
    held: bool,
) -> tuple[str, ...]:
    oe = output_error[0]
    e = exponent_of(oe)
    true = truth.get(name)
    return (
        with_symbols(name),
        scaled_unit("" if unit == "1" else unit, e),
        "" if wls is None else interval_text(*wls, e),
        f"{oe / 10.0**e:.4g} (held)" if held else interval_text(*output_error, e),
        "" if true is None else f"{true / 10.0**e:.4g}",
        "" if not true else f"{100 * (oe / true - 1):+.2f} %",
        interval_text(*TABLE_1[name], e) if paper and name in TABLE_1 else "",
    )


def _derived_row(
    identification: Identification, name: str, truth: Mapping[str, float], paper: bool
) -> tuple[str, ...]:
    item = identification.output_error.derived[name]
    top, bottom = ("X_s3", "X_s2") if name == "k_P" else ("X_s6", "X_s5")
    true = truth[top] / truth[bottom] if {top, bottom} <= truth.keys() else None
    wls = ""
    if {top, bottom} <= set(identification.wls.names):
        pair = {name: (top, bottom)}
        ideal = ratios(identification.wls, pair)
        hac = ratios(identification.wls, pair, covariance=identification.wls.covariance_hac)
        half = 2 * max(float(ideal.std[0]), float(hac.std[0]))
        wls = interval_text(float(ideal.values[0]), half)
    return (
        name,
        "",
        wls,
        interval_text(item.value, 2 * max(item.std, item.std_robust)),
        "" if true is None else f"{true:.4g}",
        "" if true is None else f"{item.value - true:+.4f}",
        f"{TABLE_1[top][0] / TABLE_1[bottom][0]:.3g}" if paper else "",
    )


def record_table(identification: Identification) -> Table:
    """Return the estimates from each record beside those from all, and how far they spread."""
    alone, result = identification.each_record, identification.output_error
    if alone is None:
        raise ModelError("the records were not fitted one by one")
    rows = []
    for column, name in enumerate(alone.names):
        item = result.parameters[name]
        e = exponent_of(item.value)
        spread = alone.spread(name)
        rows.append(
            (
                with_symbols(name),
                scaled_unit("" if item.unit == "1" else item.unit, e),
                interval_text(item.value, output_error_half_width(identification, name), e),
                *(
                    interval_text(float(value), 2 * float(std), e)
                    for value, std in zip(
                        alone.values[:, column], alone.std[:, column], strict=True
                    )
                ),
                "" if spread is None else f"{spread:.1f}",
            )
        )
    return Table(
        "Estimates from each record, output error ± 2σ",
        ("", "unit", "all records", *alone.records, "spread"),
        tuple(rows),
        (
            "Spread: distance of single records from all, in standard deviations of both (root "
            "mean square); up to about 1 where records agree.",
            "The flow map is held where all records together have left it.",
        ),
    )


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
    noise = error.rms * error.noise_percent / error.percent
    return f"{noise * factor:.3g} ({error.noise_percent:.2g} %)"


def tables_of(identification: Identification, paper: bool = False) -> Sequence[Table]:
    """Return all tables of a report, in order."""
    tables = [parameter_table(identification, paper)]
    if identification.each_record is not None:
        tables.append(record_table(identification))
    if identification.validation is not None:
        tables.append(validation_table(identification.validation))
    return tables
