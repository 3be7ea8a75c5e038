"""How large the balances' residuals are, above what noise leaves, and how surely they shrink."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.data.bench.axis_kind import AxisKind
from pneumo_casadi.diagnosis.metrics.findings import Closure
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA, Criteria, in_floors
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion
from pneumo_casadi.metrics import (
    balance_noise,
    closure,
    closure_interval,
    gap,
    resampling_weights,
    sampled_row_gains,
)
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray

#: Rows in one block of the bootstrap: half a second.
BLOCK = 32
REPLICATES = 400
#: Mass against the data sheet, which rarely includes screws, cables and sensors.
MASS = 0.05


@dataclass(frozen=True, eq=False)
class BalanceLevels:
    """What residuals are measured by.

    Parameters
    ----------
    noise : (ne,) array
        What the sensors' white noise leaves in each balance, root mean square [Pa/s, Pa/s, N; of a
        force-driven axis m/s²].
    signal : (ne,) array
        Standard deviation of what each balance explains: ṗ, or the driving force.
    criteria : Criteria
        What counts as a gap.
    """

    noise: FloatArray
    signal: FloatArray
    criteria: Criteria = CRITERIA

    def exceeded(self, rms: FloatArray, beside: float) -> NDArray[np.bool_]:
        """Tell in which balances residuals (ne,) hold more than noise and so much beside it.

        Parameters
        ----------
        rms : (ne,) array
            From `residual_rms`.
        beside : float
            A criterion for residuals, in noise floors; see `Criteria`.
        """
        return np.asarray(~(rms <= in_floors(beside) * self.noise))  # no number is no small one


def balance_levels(study: Study) -> BalanceLevels:
    """Return noise and signal of the balances of the records held out."""
    _, records = study.smoothed
    noise, signal = (
        pooled_rms(study.axis, records, [of(study.axis, data) for data in records])
        for of in (_noise, _signal)
    )
    return BalanceLevels(noise, signal, study.criteria)


def rows_that_count(axis: Axis, records: Sequence[SmoothedMotion]) -> FloatArray:
    """Return how many rows of each balance count in each record, (records, ne)."""
    return np.array([data.used(axis).sum(axis=1) for data in records], dtype=float)


def pooled_rms(
    axis: Axis, records: Sequence[SmoothedMotion], sizes: Sequence[FloatArray]
) -> FloatArray:
    """Return the root mean square over all rows that count, (ne,), of sizes by record (ne,).

    Residuals are pooled in the same way: a long record counts by its rows, and so do its sensors.
    """
    rows = rows_that_count(axis, records)
    squares = np.sum(rows * np.square(sizes), axis=0)
    return np.asarray(np.sqrt(squares / np.maximum(rows.sum(axis=0), 1)))


def _noise(axis: Axis, data: SmoothedMotion) -> FloatArray:
    gains, M = sampled_row_gains(data), _mass(axis)
    scale = force_row_scale(axis.kind, M)
    areas = [axis.constants[f"S_{chamber}"] / scale for chamber in axis.kind.gas_chambers]
    return balance_noise(data, gains, M / scale, areas)


def _mass(axis: Axis) -> float:
    """Return the mass of a right model [kg]: that of the start, as near as the data sheet has it.

    A force that shakes the axis makes the start find less than half of the mass; a model with that
    force finds all of it, and would seem to leave two floors.
    """
    M, sheet = axis.parameters["M"].value, axis.bench.datasheet.get("M_kg")
    return float(np.clip(M, (1 - MASS) * sheet, (1 + MASS) * sheet)) if sheet else M


def force_row_scale(kind: AxisKind, mass: float) -> float:
    """Return what the force balance of an equation-error fit is divided by: the mass, or 1."""
    (force,) = (balance for balance in kind.balances if not balance.chamber)
    return mass if force.over_inertia else 1.0


def _signal(axis: Axis, data: SmoothedMotion) -> FloatArray:
    rows = [
        data.dx[axis.motion_states.index(balance.state)]
        if balance.chamber
        else axis.driving_force(data.x, data.u)
        / (axis.parameters["M"].value if balance.over_inertia else 1.0)
        for balance in axis.kind.balances
    ]
    return np.asarray(np.std(data.averaged(np.stack(rows)), axis=1))


def squares(fitted: FittedModel, held_out: bool = True) -> tuple[FloatArray, FloatArray]:
    """Return squared residuals of all rows and whether they count, each (ne, m)."""
    parts = fitted.held_out if held_out else fitted.train
    used = fitted.used_held_out if held_out else fitted.used_train
    return np.hstack(parts) ** 2, np.hstack(used).astype(float)


def _squares(fitted: FittedModel, pooled: bool) -> tuple[FloatArray, FloatArray]:
    if not pooled:
        return squares(fitted)
    both = [squares(fitted, held_out) for held_out in (True, False)]
    r2, used = (np.hstack(parts) for parts in zip(*both, strict=True))
    return r2, used


def residual_rms(fitted: FittedModel, held_out: bool = True) -> FloatArray:
    """Return the root mean square residual of each balance, shape (ne,)."""
    r2, used = squares(fitted, held_out)
    return np.asarray(np.sqrt((r2 * used).sum(axis=1) / np.maximum(used.sum(axis=1), 1)))


def log_likelihood_gain(
    before: FittedModel, after: FittedModel, held_out: bool = False
) -> FloatArray:
    """Return the log-likelihood that a model gains in each balance, (ne,), on either records."""
    _, used = squares(before, held_out)
    old, new = (residual_rms(fit, held_out) for fit in (before, after))
    return np.asarray(used.sum(axis=1) * np.log(old / new))


def gain_on_all_records(before: FittedModel, after: FittedModel) -> float:
    """Return the log-likelihood that a model gains on the records fitted and those held out."""
    parts = (log_likelihood_gain(before, after, held_out) for held_out in (False, True))
    return float(sum(part.sum() for part in parts))


def gaps(rms: FloatArray, levels: BalanceLevels) -> FloatArray:
    """Return the gap of each balance beyond what a right model leaves; see `metrics.gap`."""
    return gap(rms**2, levels.noise, levels.signal, margin=in_floors(levels.criteria.background))


def shares_left(
    before: FittedModel,
    after: FittedModel,
    levels: BalanceLevels,
    clear: bool = False,
    kept: Sequence[int] = (),
) -> FloatArray:
    """Return the share of the held-out gap that a model leaves in each balance, shape (ne,).

    It is zero in balances whose gap is small compared with the largest, and in mass flow balances
    near the misfit of a coarse flow map, if another balance has a larger gap.

    With `clear` every balance in which what is left is clear of the noise counts: misfit of the
    largest gap's cause would have gone with that gap. One that had no gap before leaves all of it.
    Balances that may keep their gap, by number in `kept`, do not count.
    """
    old, new = (
        gaps(residual_rms(fit), levels) * levels.signal / levels.noise for fit in (before, after)
    )
    main = old > max(levels.criteria.main_gap * float(old.max(initial=0.0)), 1e-12)
    coarse = ~levels.exceeded(residual_rms(before), levels.criteria.coarsest_map)
    coarse[-1] = False  # the force has no map
    if np.any(main & ~coarse):
        main &= ~coarse
    if clear:
        main |= levels.exceeded(residual_rms(after), levels.criteria.clear)
        old = np.where(old > 0, old, new)
    main[list(kept)] = False
    return np.divide(new, old, out=np.zeros(len(old)), where=main)


def share_left(
    before: FittedModel,
    after: FittedModel,
    levels: BalanceLevels,
    clear: bool = False,
    kept: Sequence[int] = (),
) -> float:
    """Return the share of the held-out gap that a model leaves, in the worst balance."""
    return float(np.max(shares_left(before, after, levels, clear, kept)))


def leaves_too_much(
    before: FittedModel,
    after: FittedModel,
    levels: BalanceLevels,
    clear: bool = False,
    kept: Sequence[int] = (),
) -> bool:
    """Return whether effects that leave a visible gap in some balance do not explain it."""
    shares, criteria = shares_left(before, after, levels, clear, kept), levels.criteria
    visible = levels.exceeded(residual_rms(after), criteria.visible)
    return bool(np.any(visible & (shares > criteria.unexplained)))


def bootstrap_gain(
    before: FittedModel, after: FittedModel, levels: BalanceLevels, pooled: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return the gains of all balances and bootstrap replicates of them, (ne,) and (R, ne).

    On held-out records, with `pooled` on those fitted as well.
    """
    b, used = _squares(before, pooled)
    a, _ = _squares(after, pooled)
    sums = [_block_sums(part * used) for part in (b, a)]
    counts = _block_sums(used)
    draws = resampling_weights(counts.shape[1], REPLICATES)
    floor = levels.noise**2

    def gain(weights: FloatArray) -> FloatArray:
        n = np.maximum(counts @ weights.T, 1e-9)
        old, new = ((s @ weights.T) / n + floor[:, None] for s in sums)
        return np.asarray(0.5 * np.log(old / new).T)

    return gain(np.ones((1, counts.shape[1])))[0], gain(draws)


def balance_closure(before: FittedModel, after: FittedModel, levels: BalanceLevels) -> Closure:
    """Return the closure of the held-out gap of all balances.

    Each squared gap counts in proportion to what it was before: the balance with the gap decides.
    """
    b, used = squares(before)
    a, _ = squares(after)
    counts = _block_sums(used)
    old, new = (_block_sums(part * used) for part in (b, a))
    importance = gap(residual_rms(before) ** 2, levels.noise, levels.signal) ** 2 / levels.signal**2
    overall = [
        float(np.sqrt(importance @ gap(residual_rms(fit) ** 2, levels.noise) ** 2))
        for fit in (before, after)
    ]
    interval = closure_interval(old, new, counts, levels.noise, importance, REPLICATES)
    return Closure(closure(*overall), *interval)


def _block_sums(rows: FloatArray) -> FloatArray:
    blocks = max(1, rows.shape[1] // BLOCK)
    edges = np.linspace(0, rows.shape[1], blocks + 1).astype(int)[:-1]
    return np.asarray(np.add.reduceat(rows, edges, axis=1))
