"""Regimes: in which part of a record a balance fails, tested against shuffled blocks."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.diagnosis.locate.signatures import noise_variance, residual_floor
from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.diagnosis.metrics.regime import Condition, Regime, RegimeKind
from pneumo_casadi.diagnosis.prepare.study import FittedModel, Study
from pneumo_casadi.estimation.equation_error.smoothed_motion import (
    NOISE_MULTIPLE,
    ROW_RATE,
    SLOW,
    SmoothedMotion,
)
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray

#: Length of the blocks that are shuffled [s]: longer than residuals remember.
BLOCK = 0.5
SHUFFLES = 999
#: A regime matters from this mean square over that of the record, below this chance.
RATIO, P_VALUE = 1.3, 0.01
#: Shares that differ by less are those of one regime under two names.
SAME = 0.02
#: Larger ratios rank no higher.
RATIO_CAP = 5.0
#: A balance is looked at from this root mean square, in units of what a right model leaves.
FLOORS = 1.5
#: Fewer rows than this tell nothing of a regime.
FEWEST = 20
#: Time after a reversal that counts as such [s].
REVERSAL = 0.05
#: Critical pressure ratio of a valve that nobody metered for it.
CRITICAL = 0.3
#: Frequency bands [Hz].
BANDS = (0.0, 0.5, 2.0, 8.0, np.inf)
#: Length of the stretches of which spectra are taken [s].
STRETCH = 4.0
BINS = 12


@dataclass(frozen=True, eq=False)
class RegimeMap:
    """A balance's residual over one quantity.

    Parameters
    ----------
    name, unit : str
        Quantity: ``"u_P"``, ``"v"``, ``"x"``, ``"t"`` ... and its unit.
    balance : str
        Which.
    edges : (n + 1,) array
        Of the bins, each with as many rows.
    mean, band : (n,) array
        Mean residual, positive where the model has too much, and twice its standard deviation,
        windows' overlap counted.
    residual_unit : str
        Of both: ``"Pa/s"``, ``"N"``, and ``"m/s2"`` on the force-driven axis.
    """

    name: str
    unit: str
    balance: str
    edges: FloatArray
    mean: FloatArray
    band: FloatArray
    residual_unit: str = "N"


@dataclass(frozen=True, eq=False)
class _Rows:
    """Residuals of one balance with what went on in their rows."""

    balance: Location
    r: FloatArray
    at: Mapping[str, FloatArray]


def find_regimes(study: Study, fit: FittedModel, seed: int = 0) -> tuple[Regime, ...]:
    """Return the regimes in which balances fail more than elsewhere, the strongest first.

    Parameters
    ----------
    study : Study
        Records.
    fit : FittedModel
        Whose residuals; all its records count.
    seed : int, optional
        Of the shuffles.

    Returns
    -------
    tuple of Regime
        Of balances whose residual stands out of what a right model leaves; ordered by share ·
        log(ratio), ratios above five counting as five. Of a frequency band, `time` is the share
        of the balance's own signal in it.
    """
    rng = np.random.default_rng(seed)
    regimes: list[Regime] = []
    floor = np.mean(
        [residual_floor(study.axis, fit.values, data) for data in _records(study)], axis=0
    )
    for rows, least in zip(_all_rows(study, fit), floor, strict=True):
        if np.mean(rows.r**2) > (FLOORS * least) ** 2:
            regimes += _tested(rows, study.axis, rng)
            regimes += _bands(study, fit, rows.balance, rng)
    telling = [r for r in regimes if r.ratio > RATIO and r.p_value < P_VALUE]
    telling.sort(key=lambda r: -r.share * np.log(min(r.ratio, RATIO_CAP)))
    return tuple(r for i, r in enumerate(telling) if not any(_same(r, s) for s in telling[:i]))


def _same(regime: Regime, other: Regime) -> bool:
    """Whether two regimes of a balance are the same part of the record, but for a few rows."""
    close = abs(regime.share - other.share) < SAME and abs(regime.time - other.time) < SAME
    return close and regime.balance == other.balance


def map_regimes(study: Study, fit: FittedModel) -> tuple[RegimeMap, ...]:
    """Return every balance's residual over command, velocity, position, pressures and time."""
    units = {"u": "V", "v": "m/s", "x": "m", "p": "Pa", "t": "s", "F": "N"}
    units_of = {b.name: b.equation_error_unit for b in study.axis.kind.balances}
    maps = []
    for rows in _all_rows(study, fit):
        own = units_of[rows.balance]
        for name in _quantities(study.axis, rows.balance):
            values = rows.at[name]
            edges = np.unique(np.quantile(values, np.linspace(0, 1, BINS + 1)))
            if edges.size < 3:
                continue
            bins = np.clip(np.searchsorted(edges, values, "right") - 1, 0, edges.size - 2)
            count = np.maximum(np.bincount(bins, minlength=edges.size - 1), 1)
            mean = np.bincount(bins, rows.r, edges.size - 1) / count
            square = np.bincount(bins, rows.r**2, edges.size - 1) / count
            # Windows are four rows long: that many rows share one measurement.
            band = 2 * np.sqrt(np.maximum(square - mean**2, 0.0) * 4 / count)
            maps.append(RegimeMap(name, units[name[0]], rows.balance, edges, mean, band, own))
    return tuple(maps)


def _quantities(axis: Axis, balance: str) -> tuple[str, ...]:
    if balance == "force":
        return ("v", "x", *(f"p_{c}" for c in "PN" if f"p_{c}" in axis.outputs), "t")
    chamber = balance[-1]
    return (f"u_{chamber}", f"p_{chamber}", "v", "x", "t")


def _all_rows(study: Study, fit: FittedModel) -> Iterator[_Rows]:
    train, held = study.smoothed
    at = [_averaged(study.axis, data) for data in (*train, *held)]
    used = (*fit.used_train, *fit.used_held_out)
    for i, balance in enumerate(study.axis.equations):
        r = np.concatenate(
            [r[i][u[i]] for r, u in zip((*fit.train, *fit.held_out), used, strict=True)]
        )
        known = {
            name: np.concatenate([a[name][u[i]] for a, u in zip(at, used, strict=True)])
            for name in at[0]
        }
        yield _Rows(Location(balance), r, known)


def _averaged(axis: Axis, data: SmoothedMotion) -> dict[str, FloatArray]:
    """Return what went on in every row, by name."""
    names = (*axis.motion_states, *axis.inputs)
    v = data.x[axis.motion_states.index("v")]
    columns = [*data.x, *data.u, data.t, _after_reversal(v, data)]
    columns += [data.dx[i] for i, _ in enumerate(axis.outputs[:-1])]
    rates = tuple(f"d{name}" for name in axis.outputs[:-1])
    averages = data.averaged(np.array(columns).T).T
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


def _tested(rows: _Rows, axis: Axis, rng: np.random.Generator) -> list[Regime]:
    """Test all regimes of one balance."""
    inside = {
        condition: mask
        for condition, mask in _partition(rows, axis)
        if FEWEST <= mask.sum() <= rows.r.size - FEWEST
    }
    square = rows.r**2
    if not inside or square.sum() == 0:
        return []
    masks = np.array(list(inside.values()), dtype=float)
    shares = masks @ square / square.sum()
    length = round(BLOCK * ROW_RATE)
    count = rows.r.size // length
    blocks = np.arange(count * length).reshape(count, length)
    reached = np.ones(len(masks))
    for _ in range(SHUFFLES):
        order = blocks[rng.permutation(count)].ravel()
        # What is left of the last block stays.
        shuffled = np.concatenate([square[order], square[count * length :]])
        reached += masks @ shuffled / square.sum() >= shares
    return [
        Regime(
            condition, rows.balance, float(share), float(mask.mean()), float(hits / (SHUFFLES + 1))
        )
        for condition, share, mask, hits in zip(inside, shares, masks, reached, strict=True)
    ]


def _partition(rows: _Rows, axis: Axis) -> Iterator[tuple[Condition, NDArray[np.bool_]]]:
    at, kind = rows.at, RegimeKind
    v, x, t = at["v"], at["x"], at["t"]
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
    first, last = t.min(), t.max()
    yield Condition(kind.FIRST_THIRD), t < first + (last - first) / 3
    yield Condition(kind.LAST_THIRD), t > last - (last - first) / 3
    if rows.balance is not Location.FORCE:
        yield from _valve_regimes(rows, axis)
    elif "p_P" in at:
        mean = at["p_P"] + at["p_N"]
        yield Condition(kind.HIGH_PRESSURES), mean > np.quantile(mean, 0.75)
        yield Condition(kind.LOW_PRESSURES), mean < np.quantile(mean, 0.25)


def _valve_regimes(rows: _Rows, axis: Axis) -> Iterator[tuple[Condition, NDArray[np.bool_]]]:
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
    into, out = (_critical(axis, edge) for edge in ("supply", "exhaust"))
    yield Condition(kind.CHOKED_INFLOW, chamber=chamber), (u > 0) & (p < into * supply)
    yield Condition(kind.UNCHOKED_INFLOW, chamber=chamber), (u > 0) & (p >= into * supply)
    yield Condition(kind.CHOKED_OUTFLOW, chamber=chamber), (u < 0) & (ambient < out * p)
    yield Condition(kind.UNCHOKED_OUTFLOW, chamber=chamber), (u < 0) & (ambient >= out * p)


def _critical(axis: Axis, edge: str) -> float:
    """Return the critical pressure ratio of a metering edge."""
    values = axis.parameters.as_dict()
    return values.get(f"b_{edge}", CRITICAL)


def _bands(
    study: Study, fit: FittedModel, balance: Location, rng: np.random.Generator
) -> list[Regime]:
    """Compare the spectrum of a balance's residual with that of its signal."""
    i = study.axis.equations.index(balance)
    length = round(STRETCH * ROW_RATE)
    residual, signal = [], []
    used = (*fit.used_train, *fit.used_held_out)
    for data, r, counts in zip(_records(study), (*fit.train, *fit.held_out), used, strict=True):
        drive = data.averaged(_signal(study.axis, data, balance)[:, None])[:, 0]
        for first in range(0, data.m - length + 1, length):
            part = slice(first, first + length)
            mask = counts[i, part]
            if mask.mean() > 0.3:
                residual.append(_spectrum(r[i, part], mask))
                signal.append(_spectrum(drive[part], mask))
    if len(residual) < 6:
        return []
    R, S = np.array(residual), np.array(signal)
    R -= _noise_spectrum(study, fit, i, length)
    if R.sum() <= 0:
        return []
    f = np.fft.rfftfreq(length, 1 / ROW_RATE)
    regimes = []
    for low, high in pairwise(BANDS):
        inside = (f >= low) & (f < high)
        share, usual = R[:, inside].sum() / R.sum(), S[:, inside].sum() / S.sum()
        excess = (R[:, inside].sum(axis=1) - usual * R.sum(axis=1)) / R.sum()
        signs = rng.choice([-1.0, 1.0], size=(SHUFFLES, excess.size))
        p = (1 + np.sum(signs @ excess >= excess.sum())) / (SHUFFLES + 1)
        band = Condition(RegimeKind.BAND, low, high)
        regimes.append(Regime(band, balance, float(share), float(usual), float(p)))
    return regimes


def _noise_spectrum(study: Study, fit: FittedModel, i: int, length: int) -> FloatArray:
    """Return what the sensors' noise adds to the spectrum of balance `i`, (length // 2 + 1,)."""
    data = _records(study)[0]
    order = 2 if study.axis.equations[i] == "force" else 1
    white = data.smooth(np.random.default_rng(0).standard_normal(data.N))
    for _ in range(order):
        white = data.derivative(white)
    rows = data.averaged(white[:, None])[:, 0]
    every = [rows[k : k + length] for k in range(0, data.m - length + 1, length)]
    shape = np.mean([_spectrum(part, np.ones(length, dtype=bool)) for part in every], axis=0)
    variance = noise_variance(study.axis, fit.values, data)[i]
    return np.asarray(shape * variance / np.var(rows))


def _records(study: Study) -> Sequence[SmoothedMotion]:
    train, held = study.smoothed
    return (*train, *held)


def _signal(axis: Axis, data: SmoothedMotion, balance: str) -> FloatArray:
    if balance != "force":
        return np.asarray(data.dx[axis.motion_states.index(f"p_{balance[-1]}")])
    return axis.driving_force(data.x, data.u)


def _spectrum(values: FloatArray, mask: NDArray[np.bool_]) -> FloatArray:
    centred = np.where(mask, values - values[mask].mean(), 0.0)
    return np.asarray(np.abs(np.fft.rfft(centred * np.hanning(centred.size))) ** 2)
