"""Conditions of a record, and the rows of each balance in which they hold."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.data import Recording
from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.diagnosis.metrics.regime import Condition, RegimeKind
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.estimation.equation_error.smoothed_motion import (
    NOISE_MULTIPLE,
    SLOW,
    SmoothedMotion,
)
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray

#: Time after a reversal that counts as such [s].
REVERSAL = 0.05
#: Critical pressure ratio of a valve that nobody metered for it.
CRITICAL = 0.3


@dataclass(frozen=True, eq=False)
class BalanceRows:
    """Residuals of one balance with what went on in their rows."""

    balance: Location
    r: FloatArray
    at: Mapping[str, FloatArray]


def balance_rows(study: Study, fit: FittedModel) -> Iterator[BalanceRows]:
    """Yield the residuals of each balance, in all records, with the quantities in their rows."""
    train, held = study.smoothed
    at = [_averaged(study.axis, data) for data in (*train, *held)]
    for part, elapsed in zip(at, _elapsed(at, (*study.train, *study.held_out)), strict=True):
        part["elapsed"] = elapsed
    used = (*fit.used_train, *fit.used_held_out)
    for i, balance in enumerate(study.axis.equations):
        r = np.concatenate(
            [r[i][u[i]] for r, u in zip((*fit.train, *fit.held_out), used, strict=True)]
        )
        known = {
            name: np.concatenate([a[name][u[i]] for a, u in zip(at, used, strict=True)])
            for name in at[0]
        }
        yield BalanceRows(Location(balance), r, known)


def _elapsed(
    at: Sequence[Mapping[str, FloatArray]], records: Sequence[Recording]
) -> list[FloatArray]:
    """Return the share of its record that has gone by in every row; its parts are one record."""
    names = [(record.source, record.name.partition("[")[0]) for record in records]
    spans = []
    for name in names:
        times = np.concatenate([a["t"] for a, own in zip(at, names, strict=True) if own == name])
        spans.append((times.min(), times.max()))
    return [
        (part["t"] - first) / max(last - first, 1e-12)
        for part, (first, last) in zip(at, spans, strict=True)
    ]


def _averaged(axis: Axis, data: SmoothedMotion) -> dict[str, FloatArray]:
    """Return what went on in every row, by name."""
    names = (*axis.motion_states, *axis.inputs)
    v = data.x[axis.motion_states.index("v")]
    columns = [*data.x, *data.u, data.t, _after_reversal(v, data)]
    columns += [data.dx[i] for i, _ in enumerate(axis.outputs[:-1])]
    rates = tuple(f"d{name}" for name in axis.outputs[:-1])
    averages = data.averaged(np.array(columns))
    return dict(zip((*names, "t", "reversal", *rates), averages, strict=True))


def _after_reversal(v: FloatArray, data: SmoothedMotion) -> FloatArray:
    """Return 1 within `REVERSAL` after the velocity has changed its sign."""
    direction = np.where(np.abs(v) > max(SLOW, NOISE_MULTIPLE * data.velocity_noise), np.sign(v), 0)
    moving = np.flatnonzero(direction)
    turns = moving[1:][direction[moving][1:] != direction[moving][:-1]]
    after = np.zeros(v.size)
    for turn in turns:
        after[turn : turn + round(REVERSAL / data.dt)] = 1.0
    return after


def conditions_of(rows: BalanceRows, axis: Axis) -> Iterator[tuple[Condition, NDArray[np.bool_]]]:
    """Yield the conditions to test for a balance, each with the rows in which it holds."""
    at, kind = rows.at, RegimeKind
    v, x, elapsed = at["v"], at["x"], at["elapsed"]
    speed = np.abs(v)
    fast = float(np.quantile(speed, 0.99))
    yield Condition(kind.STANDSTILL, upper=0.01), speed < 0.01
    yield Condition(kind.SLOW, upper=0.25 * fast), speed < 0.25 * fast
    yield Condition(kind.FAST, lower=0.5 * fast), speed > 0.5 * fast
    yield Condition(kind.FORWARD), v > 0
    yield Condition(kind.BACKWARD), v < 0
    low, high = np.quantile(x, [0.002, 0.998])
    where = (x - low) / max(high - low, 1e-12)
    yield Condition(kind.LOWER_THIRD), where < 1 / 3
    yield Condition(kind.MIDDLE_THIRD), (where >= 1 / 3) & (where <= 2 / 3)
    yield Condition(kind.UPPER_THIRD), where > 2 / 3
    yield Condition(kind.TRAVEL_ENDS), np.abs(where - 0.5) > 0.4
    yield Condition(kind.AFTER_REVERSAL, upper=REVERSAL), at["reversal"] > 0.25
    yield Condition(kind.FIRST_THIRD), elapsed < 1 / 3
    yield Condition(kind.LAST_THIRD), elapsed > 2 / 3
    if rows.balance is not Location.FORCE:
        yield from _valve_regimes(rows, axis)
    elif pressures := [at[name] for name in ("p_P", "p_N") if name in at]:
        mean = np.mean(pressures, axis=0)
        yield Condition(kind.HIGH_PRESSURES), mean > np.quantile(mean, 0.75)
        yield Condition(kind.LOW_PRESSURES), mean < np.quantile(mean, 0.25)


def _valve_regimes(rows: BalanceRows, axis: Axis) -> Iterator[tuple[Condition, NDArray[np.bool_]]]:
    chamber, kind = rows.balance[-1], RegimeKind
    u, p, rate = (rows.at[f"{name}_{chamber}"] for name in ("u", "p", "dp"))
    size, span = np.abs(u), float(np.quantile(np.abs(u), 0.99))
    near, half = 0.1 * span, 0.5 * span
    yield Condition(kind.FILLING, chamber=chamber), u > 0
    yield Condition(kind.EMPTYING, chamber=chamber), u < 0
    yield Condition(kind.NEAR_NULL, upper=near, chamber=chamber), size < near
    yield Condition(kind.HALF_OPEN, near, half, chamber), (size >= near) & (size <= half)
    yield Condition(kind.WIDE_OPEN, lower=half, chamber=chamber), size > half
    yield Condition(kind.PRESSURE_RISING, chamber=chamber), rate > 0
    yield Condition(kind.PRESSURE_FALLING, chamber=chamber), rate < 0
    supply, ambient = axis.constants["p_supply"], axis.constants["p_ext"]
    into, out = (_critical(axis, edge, chamber) for edge in ("supply", "exhaust"))
    yield Condition(kind.CHOKED_INFLOW, chamber=chamber), (u > 0) & (p < into * supply)
    yield Condition(kind.UNCHOKED_INFLOW, chamber=chamber), (u > 0) & (p >= into * supply)
    yield Condition(kind.CHOKED_OUTFLOW, chamber=chamber), (u < 0) & (ambient < out * p)
    yield Condition(kind.UNCHOKED_OUTFLOW, chamber=chamber), (u < 0) & (ambient >= out * p)


def _critical(axis: Axis, edge: str, chamber: str) -> float:
    """Return the critical pressure ratio of a metering edge; of two maps each has its own."""
    values = axis.parameters.as_dict()
    return values.get(f"b_{edge}_{chamber}", values.get(f"b_{edge}", CRITICAL))
