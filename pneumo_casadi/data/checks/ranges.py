"""Values against the bench: positions within the stroke, pressures, commands, their units."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.bench.controllers import (
    Controller,
    NestedController,
    NoController,
    ProportionalController,
)
from pneumo_casadi.data.bench.driven_bench import AnyBench, ForceBench, PressureBench
from pneumo_casadi.data.bench.pid_controllers import CascadeController, PidController
from pneumo_casadi.data.bench.quantities import (
    CHARGED,
    COMPRESSION,
    LENGTHS,
    PRESSURES,
    SUPPLY_PRESSURE,
    USUAL_SUPPLY,
    Quantity,
)
from pneumo_casadi.data.checks.finding import ContradictionError, Finding, Grade
from pneumo_casadi.data.readers.column_entries import ColumnEntries
from pneumo_casadi.data.recording.channels import UNITS
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.data.recording.samples import noise_of
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray

STROKE_MARGIN = 0.005  # share of the stroke by which a cushion or a sensor may exceed it
VACUUM_MARGIN = 0.1  # share of p_ext by which a chamber may fall below it
OTHER_UNIT = 5.0  # beyond this multiple of its limit a value has another unit
LARGEST = 1e9  # SI units: a thousand times the supply pressure, the largest signal of an axis
BEST_BORE = 1e-3  # a bore of 32 mm known to 0.016 mm; hardly an area is known better [1]
HALF_DECADE = 10**0.5  # of noise, by which units of lengths are told apart
WIDESPREAD = 0.05  # share of the rows beyond which the column, not a spike, is wrong


def check_statements(bench: AnyBench, entries: ColumnEntries) -> Iterator[Finding]:
    """Yield what bench.json and columns.json state in another unit than theirs, all in range."""
    accuracy = getattr(bench, "area_accuracy", BEST_BORE)
    if accuracy < BEST_BORE:
        percent = 100 * accuracy
        yield Finding(
            Grade.CAUTION,
            "accuracy of the areas",
            "S_P, S_N",
            f"`area_accuracy_percent` = {percent:g}: is {100 * percent:g} % meant? It is "
            "in per cent, and few bores are known so well; intervals of X_s depend on it.",
            "bench.json",
            {"area_accuracy_percent": float(f"{100 * percent:g}")},
        )
    ambient, stroke = getattr(bench, "p_ext", 0.0), bench.stroke or 0.0
    expected = dict.fromkeys(("p_P", "p_N", "p_supply"), ambient)
    expected |= dict.fromkeys(("x", "x_ref"), stroke / 2)
    alike: dict[tuple[str, float, float], list[str]] = {}
    for name, size in expected.items():
        offset = entries.offset_in_own_unit(name, size)
        if offset is not None:
            alike.setdefault((UNITS[name], *offset), []).append(name)
    for (unit, stated, meant), names in alike.items():
        suggestion: dict[str, Any] = {}
        for name in names:
            suggestion |= entries.corrected(name, offset=meant)
        yield Finding(
            Grade.SEVERE,
            "offset in another unit",
            ", ".join(names),
            f"`offset` is in {unit}, not in the unit of the column: {stated:g} {unit} is added to "
            f"{' and '.join(f'`{name}`' for name in names)}; is {meant:g} {unit} meant?",
            "columns.json",
            suggestion,
        )


def check_ranges(recording: Recording, bench: AnyBench, entries: ColumnEntries) -> None:
    """Check every value of positions, pressures and inputs against the bench.

    Raises
    ------
    CaseError
        Naming the first row outside, its value, and the unit it may be in.
    """
    for name in recording.names:
        k = int(np.argmax(np.abs(recording[name])))
        if abs(recording[name][k]) > LARGEST:
            raise CaseError(
                f"{recording.where(k)}: `{name}` is {recording[name][k]:g} {UNITS[name]}, which no "
                "axis has; cut these rows out, or correct the column"
            )
    if isinstance(bench, Bench):
        _check_position(recording, bench, entries)
        for channel in ("p_P", "p_N", "p_supply"):
            if channel in recording:
                _check_pressure(recording, channel, bench, entries)
        limit = largest_command(bench.controller)
        if limit is not None:
            _check_symmetric(recording, ("u_P", "u_N"), limit, "V", {"mV": 1e-3}, entries)
    else:
        _check_travel(recording, bench)
        if isinstance(bench, PressureBench):
            for channel in ("p_P", "p_N") if bench.S_N else ("p_P",):
                _check_pressure(recording, channel, bench, entries)
        if isinstance(bench.controller, NestedController):
            limit = abs(bench.controller.gain) * bench.controller.u_max
            _check_symmetric(recording, ("F",), limit, "N", {"kN": 1e3}, entries)


def largest_command(controller: Controller) -> float | None:
    """Return how far a controller can drive a valve [V]; None where that is not known."""
    if isinstance(controller, ProportionalController | PidController | CascadeController):
        return max(map(abs, controller.limits)) + abs(controller.u_0)
    return controller.u_max if isinstance(controller, NoController) else None


def _check_position(recording: Recording, bench: Bench, entries: ColumnEntries) -> None:
    margin = STROKE_MARGIN * bench.stroke + (5 * bench.noise.x if bench.noise else 0.0)
    lower, upper = (bench.stroke_limits[0] - margin, bench.stroke_limits[1] + margin)
    x = recording["x"]
    far = max(np.abs(x).max(), np.ptp(x) / 2) > OTHER_UNIT * upper
    units = LENGTHS if far else {"m": (1.0, 0.0)}
    from_end = {
        f"{unit} from the end of the stroke (subtract l/2)": (scale, -bench.stroke / 2)
        for unit, (scale, _) in units.items()
        # What fits from mid-stroke too is left to the balances, which tell the two apart.
        if scale * float(x.max()) > upper
    }
    quantity = Quantity("m from mid-stroke", lower, upper, {**(units if far else {}), **from_end})
    noise = bench.noise.x if bench.noise else None
    _check(recording, "x", quantity, "stroke exceeded", entries, noise)


def _check_travel(recording: Recording, bench: ForceBench | PressureBench) -> None:
    if bench.stroke is None:
        return
    x = recording["x"]
    travel, k = float(np.ptp(x)), int(np.argmax(np.abs(x - x[0])))
    if travel > bench.stroke * (1 + STROKE_MARGIN):
        unit = Quantity("m", 0.0, bench.stroke, LENGTHS).guess(travel)
        other = unit if travel > OTHER_UNIT * bench.stroke else ""
        raise CaseError(
            f"{recording.where(k)}: `x` = {x[k]:g} m: the record travels {travel:g} m, the stroke "
            f"is {bench.stroke:g} m; {other or 'correct x or the stroke'}"
        )


def _check_pressure(
    recording: Recording, channel: str, bench: Bench | PressureBench, entries: ColumnEntries
) -> None:
    supply = bench.p_supply if isinstance(bench, Bench) else SUPPLY_PRESSURE.upper
    lower, upper = (1 - VACUUM_MARGIN) * bench.p_ext, COMPRESSION * supply
    highest = float(recording[channel].max())
    usual = supply if isinstance(bench, Bench) else USUAL_SUPPLY
    span = CHARGED * (usual - bench.p_ext)
    gauge = {
        f"gauge {unit}": (scale, bench.p_ext)
        for unit, (scale, _) in {"Pa": (1.0, 0.0), **PRESSURES}.items()
        if scale * highest > span  # with the ambient pressure added every small number is plausible
    }
    units = {**PRESSURES, **gauge}
    above = highest > upper
    what = (
        f"far above the supply pressure {supply:g} Pa"
        if above
        else f"below the ambient pressure {bench.p_ext:g} Pa"
    )
    _check(recording, channel, Quantity("absolute Pa", lower, upper, units), what, entries)


def _check_symmetric(
    recording: Recording,
    channels: tuple[str, ...],
    limit: float,
    unit: str,
    others: dict[str, float],
    entries: ColumnEntries,
) -> None:
    end = 1.001 * limit  # rounding in the file
    units = {other: (scale, 0.0) for other, scale in others.items()}
    for channel in channels:
        far = float(np.abs(recording[channel]).max()) > OTHER_UNIT * end
        quantity = Quantity(unit, -end, end, units if far else {})
        what = f"beyond `controller.u_max` ({limit:g} {unit})"
        _check(recording, channel, quantity, what, entries)


def _check(
    recording: Recording,
    channel: str,
    quantity: Quantity,
    what: str,
    entries: ColumnEntries,
    noise: float | None = None,
) -> None:
    values = recording[channel]
    wrong = np.flatnonzero((values < quantity.lower) | (values > quantity.upper))
    if not wrong.size:
        return
    k = int(wrong[0])
    units = quantity.units_that_fit(float(values.min()), float(values.max()))
    suggestion: dict[str, Any] = {}
    if wrong.size <= WIDESPREAD * values.size or not units:
        remedy = "cut these rows out, or correct the column or bench.json"
    else:
        remedy = f"is it in {' or '.join(units)}?"
        fitting = [quantity.mistaken[unit] for unit in units]
        lengths = UNITS[channel] == "m"
        factor, offset = _likeliest(fitting, values, noise) if lengths else fitting[0]
        for name in _read_alike(recording, channel, quantity) if factor else ():
            suggestion |= entries.corrected(name, factor=factor, offset=offset)
    raise ContradictionError(
        Finding(
            Grade.SEVERE,
            "unit" if suggestion else "out of range",
            channel,
            f"{recording.where(k)}: `{channel}`: expected {quantity.unit} between "
            f"{quantity.lower:.6g} and {quantity.upper:.6g}, got {values[k]:g} ({what}; "
            f"{wrong.size} of {values.size} rows); {remedy}",
            "columns.json" if suggestion else "",
            suggestion,
        )
    )


def _likeliest(
    conversions: Sequence[tuple[float, float]], values: FloatArray, noise: float | None
) -> tuple[float, float]:
    """Return scale and offset that fit, by the noise stated where scales differ; 0 if in doubt."""
    if len({scale for scale, _ in conversions}) == 1:
        return conversions[0]
    if noise:
        estimated = noise_of(values)
        for scale, offset in conversions:
            if 1 / HALF_DECADE < scale * estimated / noise < HALF_DECADE:
                return scale, offset
    return 0.0, 0.0


def _read_alike(recording: Recording, channel: str, quantity: Quantity) -> list[str]:
    """Return the channel, and those of the same kind that lie outside its range as well."""
    families = (("x", "x_ref"), ("p_P", "p_N"), ("u_P", "u_N"))
    family = next((names for names in families if channel in names), (channel,))
    return [
        name
        for name in family
        if name in recording
        and (recording[name].min() < quantity.lower or recording[name].max() > quantity.upper)
    ]
