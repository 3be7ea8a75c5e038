"""Values against the bench: positions within the stroke, pressures, commands, their units."""

import numpy as np

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.bench.controllers import NestedController, ProportionalController
from pneumo_casadi.data.bench.driven_bench import AnyBench, ForceBench, PressureBench
from pneumo_casadi.data.bench.quantities import LENGTHS, PRESSURES, Quantity
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.errors import CaseError

STROKE_MARGIN = 0.005  # share of the stroke by which a cushion or a sensor may exceed it
VACUUM_MARGIN = 0.1  # share of p_ext by which a chamber may fall below it
COMPRESSION = 1.5  # a closed chamber may be compressed above the supply pressure
OTHER_UNIT = 5.0  # beyond this multiple of its limit a value has another unit
WIDESPREAD = 0.05  # share of the rows beyond which the column, not a spike, is wrong


def check_ranges(recording: Recording, bench: AnyBench) -> None:
    """Check every value of positions, pressures and inputs against the bench.

    Raises
    ------
    CaseError
        Naming the first row outside, its value, and the unit it may be in.
    """
    if isinstance(bench, Bench):
        _check_position(recording, bench)
        for channel in ("p_P", "p_N"):
            _check_pressure(recording, channel, bench)
        if isinstance(bench.controller, ProportionalController):
            limit = bench.controller.u_max
            _check_symmetric(recording, ("u_P", "u_N"), limit, "V", {"mV": 1e-3})
    else:
        _check_travel(recording, bench)
        if isinstance(bench.controller, NestedController):
            limit = abs(bench.controller.gain) * bench.controller.u_max
            _check_symmetric(recording, ("F",), limit, "N", {"kN": 1e3})


def _check_position(recording: Recording, bench: Bench) -> None:
    margin = STROKE_MARGIN * bench.stroke + (5 * bench.noise.x if bench.noise else 0.0)
    lower, upper = (bench.stroke_limits[0] - margin, bench.stroke_limits[1] + margin)
    x = recording["x"]
    if max(abs(x.min()), abs(x.max())) > OTHER_UNIT * upper:
        units = LENGTHS
    else:
        units = {"m from the end of the stroke (subtract l/2)": (1.0, -bench.stroke / 2)}
    _check(recording, "x", Quantity("m from mid-stroke", lower, upper, units), "stroke exceeded")


def _check_travel(recording: Recording, bench: ForceBench | PressureBench) -> None:
    if bench.stroke is None:
        return
    x = recording["x"]
    travel, k = float(np.ptp(x)), int(np.argmax(np.abs(x - x[0])))
    if travel > bench.stroke * (1 + STROKE_MARGIN):
        raise CaseError(
            f"{recording.where(k)}: `x` = {x[k]:g} m: the record travels {travel:g} m, the stroke "
            f"is {bench.stroke:g} m; "
            + ("is it in mm?" if travel > OTHER_UNIT * bench.stroke else "correct x or the stroke")
        )


def _check_pressure(recording: Recording, channel: str, bench: Bench) -> None:
    lower, upper = (1 - VACUUM_MARGIN) * bench.p_ext, COMPRESSION * bench.p_supply
    gauge = {f"gauge {unit}": (scale, bench.p_ext) for unit, (scale, _) in PRESSURES.items()}
    units = {**PRESSURES, "gauge Pa": (1.0, bench.p_ext), **gauge}
    above = float(recording[channel].max()) > upper
    what = (
        f"far above the supply pressure {bench.p_supply:g} Pa"
        if above
        else f"below the ambient pressure {bench.p_ext:g} Pa"
    )
    _check(recording, channel, Quantity("absolute Pa", lower, upper, units), what)


def _check_symmetric(
    recording: Recording,
    channels: tuple[str, ...],
    limit: float,
    unit: str,
    others: dict[str, float],
) -> None:
    limit *= 1.001  # rounding in the file
    units = {other: (scale, 0.0) for other, scale in others.items()}
    for channel in channels:
        far = float(np.abs(recording[channel]).max()) > OTHER_UNIT * limit
        quantity = Quantity(unit, -limit, limit, units if far else {})
        _check(recording, channel, quantity, f"beyond the controller's u_max ({limit:g} {unit})")


def _check(recording: Recording, channel: str, quantity: Quantity, what: str) -> None:
    values = recording[channel]
    wrong = np.flatnonzero((values < quantity.lower) | (values > quantity.upper))
    if not wrong.size:
        return
    k = int(wrong[0])
    guess = quantity.guess(float(values.min()), float(values.max()))
    if wrong.size <= WIDESPREAD * values.size or not guess:
        guess = "cut these rows out, or correct the column or bench.json"
    raise CaseError(
        f"{recording.where(k)}: `{channel}`: expected {quantity.unit} between {quantity.lower:.6g} "
        f"and {quantity.upper:.6g}, got {values[k]:g} ({what}; {wrong.size} of {values.size} "
        f"rows); {guess}"
    )
