"""Gap and closure: how far simulation and measurement disagree, and what an effect closes of it.

The **gap** of a channel (an output, or the residual of a balance) is the root mean square error on
held-out data after the noise floor has been subtracted, relative to the signal:

    G = √max(e_rms² − (margin σ)², 0) / s

with e_rms the root mean square error, σ the noise floor (`pneumo_casadi.metrics.noise_floor`) and
s the standard deviation of the signal; reports multiply by 100 and print per cent. The gap of
several channels is the root mean square of their gaps (`combined_gap`). Squares are subtracted, not
amplitudes, because noise and model error are uncorrelated.

The **closure** is the share of a gap that a change of the model closes, 1 − G_after/G_before. Its
95 % interval comes from resampling blocks of the held-out data, the same blocks before and after,
so that what both have in common cancels (`closure_interval`).

Who uses which errors:

====================================  ============================  =======================  ======
used by                               errors                        noise floor              margin
====================================  ============================  =======================  ======
validation, the gap of a diagnosis,   simulated outputs             sensor noise, stated or  1
benchmarks                                                          estimated
acceptance of effects, verdict        residuals of the balances     sensor noise through     1.1
                                                                    the filters
closure in the ranking                residuals of the balances     the same                 1
sealed check                          residuals of the balances     residuals of the twin    1
                                                                    without effects
====================================  ============================  =======================  ======

The margin of 1.1 covers what filters, flow map and quantisation leave in a balance where nothing is
wrong: decisions must not react to it. Figures that are reported subtract the noise alone.
"""

from collections.abc import Sequence

import numpy as np

from pneumo_casadi.parameters import FloatArray

#: Probabilities at the ends of the intervals.
LEVELS = (0.025, 0.975)


def gap(
    mean_square: float | FloatArray,
    noise: float | FloatArray,
    signal: float | FloatArray = 1.0,
    margin: float = 1.0,
) -> FloatArray:
    """Return the gap of each channel.

    Parameters
    ----------
    mean_square : float or array
        Mean square errors, in the unit of the channel squared.
    noise : float or array
        Noise floors, standard deviations in the unit of the channel.
    signal : float or array, optional
        Standard deviations of the signals; 1 where errors and noise are relative to it already.
    margin : float, optional
        Factor on the noise floor.

    Returns
    -------
    array
        Gap relative to the signal, of the broadcast shape.

    Examples
    --------
    >>> float(gap(25.0, 3.0, signal=8.0))
    0.5
    >>> float(gap(8.0, 3.0))
    0.0
    """
    floor = margin * np.asarray(noise)
    return np.asarray(np.sqrt(np.maximum(np.asarray(mean_square) - floor**2, 0.0)) / signal)


def combined_gap(gaps: Sequence[float] | FloatArray) -> float:
    """Return the gap of several channels: the root mean square of theirs.

    Parameters
    ----------
    gaps : (n,) array
        Gaps of the channels, relative to their signals [1 or %].

    Examples
    --------
    >>> combined_gap([1.0, 7.0])
    5.0
    """
    return float(np.sqrt(np.mean(np.square(gaps))))


def closure(before: float, after: float) -> float:
    """Return the share of a gap that is closed; negative where it grows, 0 where there was none.

    Parameters
    ----------
    before, after : float
        Gap without and with the change of the model, in the same unit.

    Examples
    --------
    >>> closure(4.0, 1.0), closure(0.0, 0.0)
    (0.75, 0.0)
    """
    return 1.0 - after / before if before > 0 else 0.0


def closure_interval(
    before: FloatArray,
    after: FloatArray,
    counts: FloatArray,
    noise: FloatArray,
    importance: FloatArray,
    replicates: int,
) -> tuple[float, float]:
    """Return the 95 % interval of a closure from a block bootstrap.

    Parameters
    ----------
    before, after : (n, blocks) array
        Sums of squared errors of every channel in every block.
    counts : (n, blocks) array
        Number of errors in each sum.
    noise : (n,) array
        Noise floors.
    importance : (n,) array
        Weight of each channel's squared gap in that of all.
    replicates : int
        Number of resampled data sets.

    Notes
    -----
    Every replicate draws as many blocks as there are, with replacement, for both models alike
    (Efron and Tibshirani 1993, An Introduction to the Bootstrap, ch. 8). Where no channel had a
    gap, in all or in a replicate, nothing is closed, as `closure` has it.
    """
    if not np.any(importance):
        return 0.0, 0.0
    weights = resampling_weights(counts.shape[1], replicates)
    number = np.maximum(counts @ weights.T, 1e-9)
    floor = np.asarray(noise)[:, None]
    gaps = [
        np.sqrt(importance @ gap((sums @ weights.T) / number, floor) ** 2)
        for sums in (before, after)
    ]
    share_left = np.divide(gaps[1], gaps[0], out=np.ones(replicates), where=gaps[0] > 0)
    closures = 1.0 - share_left
    lower, upper = np.quantile(closures, LEVELS)
    return float(lower), float(upper)


def resampling_weights(blocks: int, replicates: int) -> FloatArray:
    """Return how often each block is drawn in each replicate, (replicates, blocks); seed 0."""
    rng = np.random.default_rng(0)
    drawn = rng.multinomial(blocks, np.full(blocks, 1 / blocks), size=replicates)
    return np.asarray(drawn, dtype=float)
