"""How large the balances' residuals are, above what noise leaves, and how surely they shrink."""

from dataclasses import dataclass

import numpy as np

from pneumo_casadi.diagnosis.metrics.findings import Closure
from pneumo_casadi.diagnosis.prepare.study import FittedModel, Study
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray

#: Rows in one block of the bootstrap: half a second.
BLOCK = 32
REPLICATES = 400
#: What is left where nothing is wrong, over the noise floor: filters, map and quantisation.
BACKGROUND = 1.1
#: The same of mass flow balances where a metered map is coarse beside what a valve does near null.
COARSE_MAP = 1.5
#: Mass flow residuals over the noise floor up to which a coarse map may be all there is to them:
#: two axes of the virtual bench without any effect in these balances had 1.8.
NEAR_NULL = 1.9
#: Bounds of the intervals [1].
LEVELS = (0.025, 0.975)


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
    """

    noise: FloatArray
    signal: FloatArray


def balance_levels(study: Study) -> BalanceLevels:
    """Return noise and signal of the balances of the records held out."""
    _, data = study.smoothed
    noise = np.mean([_noise(study.axis, record) for record in data], axis=0)
    signal = np.sqrt(np.mean([_signal(study.axis, record) ** 2 for record in data], axis=0))
    return BalanceLevels(noise, signal)


def _noise(axis: Axis, data: SmoothedMotion) -> FloatArray:
    """Pass unit noise through the filters, and scale it."""
    N = min(data.N, 4096)
    e = np.random.default_rng(0).normal(size=N)
    weak = data.weak[: max(1, data.m * N // data.N - 4), :N]
    level = data.smooth(e)
    rate = data.derivative(level)
    bend = data.derivative(rate)
    gain = [float(np.std(weak @ one)) for one in (level, rate, bend)]
    noise = dict(zip(axis.outputs, data.noise, strict=True))
    c, M = axis.constants, axis.parameters["M"].value
    areas = [c[f"S_{chamber}"] * noise[f"p_{chamber}"] for chamber in axis.kind.gas_chambers]
    force = np.hypot(M * gain[2] * noise["x"], float(np.linalg.norm(areas)) * gain[0])
    return np.array(
        [
            gain[1] * noise[balance.state]
            if balance.chamber
            else force / (M if balance.over_inertia else 1.0)
            for balance in axis.kind.balances
        ]
    )


def _signal(axis: Axis, data: SmoothedMotion) -> FloatArray:
    rows = [
        data.dx[axis.motion_states.index(balance.state)]
        if balance.chamber
        else axis.driving_force(data.x, data.u)
        / (axis.parameters["M"].value if balance.over_inertia else 1.0)
        for balance in axis.kind.balances
    ]
    return np.asarray(np.std(data.averaged(np.column_stack(rows)), axis=0))


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


def gaps(rms: FloatArray, levels: BalanceLevels) -> FloatArray:
    """Return what lies above the noise floor in each balance, as a share of the signal."""
    floor = BACKGROUND * levels.noise
    return np.asarray(np.sqrt(np.maximum(rms**2 - floor**2, 0)) / levels.signal)


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
    draws = _draws(counts.shape[1])
    floor = levels.noise**2

    def gain(weights: FloatArray) -> FloatArray:
        n = np.maximum(counts @ weights.T, 1e-9)
        one, other = ((s @ weights.T) / n + floor[:, None] for s in sums)
        return np.asarray(0.5 * np.log(one / other).T)

    return gain(np.ones((1, counts.shape[1])))[0], gain(draws)


def block_gain(
    before: FittedModel, after: FittedModel, levels: BalanceLevels, pooled: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return the mean over blocks of log(σ_before/σ_after), (ne,), and replicates, (R, ne)."""
    b, used = _squares(before, pooled)
    a, _ = _squares(after, pooled)
    counts = _block_sums(used)
    present = (counts > 0).astype(float)
    n, floor = np.maximum(counts, 1), levels.noise[:, None] ** 2
    one, other = (_block_sums(part * used) / n + floor for part in (b, a))
    logs = 0.5 * np.log(one / other) * present

    def gain(weights: FloatArray) -> FloatArray:
        return np.asarray((logs @ weights.T / np.maximum(present @ weights.T, 1e-9)).T)

    return gain(np.ones((1, counts.shape[1])))[0], gain(_draws(counts.shape[1]))


def balance_closure(before: FittedModel, after: FittedModel, levels: BalanceLevels) -> Closure:
    """Return how far the held-out gap of the balances closes, over all of them.

    1 - G_after/G_before with G² the mean of the squared gaps, each as a share of its signal
    weighted by what it was without any effect: the balance with the gap decides.
    """
    b, used = squares(before)
    a, _ = squares(after)
    counts = _block_sums(used)
    sums = [_block_sums(part * used) for part in (b, a)]
    unit = residual_rms(before) ** 2
    floor = levels.noise**2

    def closure(weights: FloatArray) -> FloatArray:
        n = np.maximum(counts @ weights.T, 1e-9)
        one, other = (np.maximum((s @ weights.T) / n - floor[:, None], 0) for s in sums)
        weight = (np.maximum(unit - floor, 0) / levels.signal**2)[:, None]
        scale = weight / levels.signal[:, None] ** 2
        total = np.maximum((scale * one).sum(axis=0), 1e-300)
        return np.asarray(1 - np.sqrt((scale * other).sum(axis=0) / total))

    value = float(closure(np.ones((1, counts.shape[1])))[0])
    found = np.quantile(closure(_draws(counts.shape[1])), LEVELS)
    return Closure(value, float(found[0]), float(found[1]))


def _block_sums(rows: FloatArray) -> FloatArray:
    blocks = max(1, rows.shape[1] // BLOCK)
    edges = np.linspace(0, rows.shape[1], blocks + 1).astype(int)[:-1]
    return np.asarray(np.add.reduceat(rows, edges, axis=1))


def _draws(blocks: int) -> FloatArray:
    """Return how often each block is drawn in each replicate, shape (R, blocks)."""
    rng = np.random.default_rng(0)
    return np.asarray(rng.multinomial(blocks, np.full(blocks, 1 / blocks), size=REPLICATES), float)
