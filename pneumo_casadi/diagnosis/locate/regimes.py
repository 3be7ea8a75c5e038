"""Regimes: in which part of a record a balance fails, tested against shuffled blocks."""

import numpy as np

from pneumo_casadi.diagnosis.locate.frequency_bands import SHUFFLES, band_regimes
from pneumo_casadi.diagnosis.locate.regime_conditions import (
    BalanceRows,
    balance_rows,
    conditions_of,
)
from pneumo_casadi.diagnosis.locate.signatures import residual_floor
from pneumo_casadi.diagnosis.metrics.regime import Regime
from pneumo_casadi.diagnosis.metrics.residual_size import pooled_rms
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.model.axis import Axis

#: Length of the blocks that are shuffled [s]: longer than residuals remember.
BLOCK = 0.5
#: A regime matters from this mean square over that of the record, below this chance.
RATIO, P_VALUE = 1.3, 0.01
#: Shares that differ by less are those of one regime under two names.
SAME = 0.02
#: Larger ratios rank no higher.
RATIO_CAP = 5.0
#: A balance is looked at from this root mean square, in units of the residuals of a correct model.
FLOORS = 1.5
#: Fewer rows than this tell nothing of a regime.
FEWEST = 20


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
        Of balances whose residual exceeds that of a correct model; ordered by share · log(ratio),
        ratios above five counting as five. Of a frequency band, `time` is the share
        of the balance's own signal in it.
    """
    rng = np.random.default_rng(seed)
    regimes: list[Regime] = []
    records = study.all_smoothed
    floors = [residual_floor(study.axis, fit.values, data) for data in records]
    floor = pooled_rms(study.axis, records, floors)
    for rows, least in zip(balance_rows(study, fit), floor, strict=True):
        if np.mean(rows.r**2) > (FLOORS * least) ** 2:
            regimes += _tested(rows, study.axis, study.all_smoothed[0].row_rate, rng)
            regimes += band_regimes(study, fit, rows.balance, rng)
    telling = [r for r in regimes if r.ratio > RATIO and r.p_value < P_VALUE]
    telling.sort(key=lambda r: -r.share * np.log(min(r.ratio, RATIO_CAP)))
    return tuple(r for i, r in enumerate(telling) if not any(_same(r, s) for s in telling[:i]))


def _same(regime: Regime, other: Regime) -> bool:
    """Return whether two regimes of a balance cover the same rows, except for a few."""
    close = abs(regime.share - other.share) < SAME and abs(regime.time - other.time) < SAME
    return close and regime.balance == other.balance


def _tested(rows: BalanceRows, axis: Axis, rate: float, rng: np.random.Generator) -> list[Regime]:
    """Test all regimes of one balance, whose rows follow each other at some rate [1/s]."""
    inside = {
        condition: mask
        for condition, mask in conditions_of(rows, axis)
        if FEWEST <= mask.sum() <= rows.r.size - FEWEST
    }
    square = rows.r**2
    if not inside or square.sum() == 0:
        return []
    masks = np.array(list(inside.values()), dtype=float)
    shares = masks @ square / square.sum()
    length = round(BLOCK * rate)
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
