"""Tables of estimates: WLS, output error, truth and paper side by side; each record by itself."""

from collections.abc import Mapping

from pneumo_casadi.data import Bench, PressureBench
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.flow_scale import flow_factors
from pneumo_casadi.estimation.statistics import EstimateStatus
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.report.tables.paper import TABLE_1
from pneumo_casadi.report.tables.table import (
    Table,
    exponent_of,
    interval_text,
    scaled_unit,
    with_symbols,
)

#: What Table 1 is, below the tables that show it.
PAPER = (
    'Table 1: estimates ± 2σ of "Identification of physical parameters of a pneumatic '
    'servosystem" (IFAC 2005), on the bench of its authors.'
)

#: The parameters that have the scale of a flow meter, and how it is called, by its chambers.
METERS = {
    "PN": ("X_s1 ... X_s6", "the flow meter"),
    "P": ("X_s1 ... X_s3", "the flow meter of chamber P's valve"),
    "N": ("X_s4 ... X_s6", "the flow meter of chamber N's valve"),
}

#: What the intervals of estimates include.
INTERVALS = (
    "2σ includes the correlation of the residuals, the noise of a metered flow map and, in output "
    "error, the biases of the smoothed friction and of the form of the map. It does not include "
    "the bias of an incomplete model."
)
#: Estimates that may be compared with the truth.
TRUSTED = (EstimateStatus.ESTIMATED, EstimateStatus.HELD)


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
        rows.append(_row(identification, name, item.unit, wls, truth, paper))
    for name in ("k_P", "k_N"):
        if name in identification.output_error.derived:
            rows.append(_derived_row(identification, name, truth, paper))
    columns = ["", "unit", "WLS", "output error", "truth", "OE - truth", "Table 1"]
    table = Table(
        "Identified parameters, estimate ± 2σ",
        tuple(columns),
        tuple(rows),
        (
            INTERVALS,
            *scale_notes(identification),
            *((PAPER,) if paper else ()),
        ),
    )
    absent = [] if truth else ["truth", "OE - truth"]
    return table.without(*absent, *([] if paper else ["Table 1"]))


def scale_notes(identification: Identification) -> tuple[str, ...]:
    """Return on which source the scale of X_s1 ... X_s6 rests, and how well that is known."""
    bench = identification.case.bench
    free = identification.output_error.parameters.free_names
    if isinstance(bench, PressureBench) and "S_P" not in free:
        return (
            "M, f_v and F_c have the scale of the piston areas in bench.json, known to "
            f"{100 * bench.area_accuracy:.2g} % (1σ, not in 2σ above).",
        )
    if not isinstance(bench, Bench):
        return ()
    if not bench.valves.metered:
        return (
            "No valve was metered: X_s1 ... X_s6 have the scale of the piston areas in bench.json, "
            f"known to {100 * bench.area_accuracy:.2g} % (1σ, in 2σ above); M and friction rest "
            "on the areas, the pressures and the motion, not on the valve.",
        )
    return tuple(
        _meter_note(*METERS[chambers], 100 * std)
        for chambers, std in flow_factors(identification.axis).items()
    )


def _meter_note(names: str, meter: str, percent: float) -> str:
    """Return what is known of the scale that a flow meter gives to some parameters."""
    if percent > 0:
        return (
            f"{names} have the scale of {meter}, whose stated accuracy of "
            f"{percent:.2g} % (1σ) is in 2σ."
        )
    return (
        f"The accuracy of {meter} is not stated (valve.accuracy_percent in bench.json), and "
        f"not in 2σ: a map metered 1 % too high makes {names} 1 % too large."
    )


def wls_estimate(identification: Identification, name: str) -> tuple[float, float] | None:
    """Return a WLS estimate and its 2σ; None where WLS does not estimate the parameter."""
    if name not in identification.wls.names:
        return None
    at = identification.wls.names.index(name)
    return float(identification.wls.estimate[at]), wls_half_width(identification, name)


def wls_half_width(identification: Identification, name: str) -> float:
    """Return 2σ of a WLS estimate, which allows for correlation and for the flow map's noise."""
    at = identification.wls.names.index(name)
    return 2 * float(identification.wls.std_hac[at])


def output_error_half_width(identification: Identification, name: str) -> float | None:
    """Return 2σ of an output-error estimate, the wider of ideal and robust; None without one."""
    result = identification.output_error
    if result.status_of(name) is not EstimateStatus.ESTIMATED:
        return None
    return 2 * max(result.std(name), result.std(name, robust=True))


def output_error_text(identification: Identification, name: str, exponent: int = 0) -> str:
    """Return an output-error estimate ± 2σ, or why it has no interval.

    A value about which the data say nothing is that of the start, and is not shown.
    """
    result = identification.output_error
    status = result.status_of(name)
    if status is EstimateStatus.UNINFORMED:
        return status.value
    known = result.derived if name in result.derived else result.parameters
    value = known[name].value
    if status is EstimateStatus.ESTIMATED:
        return interval_text(value, output_error_half_width(identification, name), exponent)
    return f"{value / 10.0**exponent:.4g} ({status.value})"


def _row(
    identification: Identification,
    name: str,
    unit: str,
    wls: tuple[float, float] | None,
    truth: Mapping[str, float],
    paper: bool,
) -> tuple[str, ...]:
    oe = identification.output_error.parameters[name].value
    trusted = identification.output_error.status_of(name) in TRUSTED
    e = exponent_of(oe)
    true = truth.get(name)
    return (
        with_symbols(name),
        scaled_unit("" if unit == "1" else unit, e),
        "" if wls is None else interval_text(*wls, e),
        output_error_text(identification, name, e),
        "" if true is None else f"{true / 10.0**e:.4g}",
        f"{100 * (oe - true) / abs(true):+.2f} %" if true and trusted else "",
        interval_text(*TABLE_1[name], e) if paper and name in TABLE_1 else "",
    )


def _derived_row(
    identification: Identification, name: str, truth: Mapping[str, float], paper: bool
) -> tuple[str, ...]:
    item = identification.output_error.derived[name]
    top, bottom = ("X_s3", "X_s2") if name == "k_P" else ("X_s6", "X_s5")
    true = truth[top] / truth[bottom] if {top, bottom} <= truth.keys() else None
    derived = identification.wls.derived
    linear = {} if derived is None else derived.as_dict()
    wls = interval_text(linear[name]["value"], 2 * linear[name]["std"]) if name in linear else ""
    return (
        name,
        "",
        wls,
        output_error_text(identification, name),
        "" if true is None else f"{true:.4g}",
        "" if true is None or item.status not in TRUSTED else f"{item.value - true:+.4f}",
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
                output_error_text(identification, name, e),
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
            "Spread: distance of single columns from their mean, in their standard deviations "
            "(root mean square over n - 1); about 1 where records agree.",
            "The flow map is held where all records together have left it.",
        ),
    )
