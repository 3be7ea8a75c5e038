"""Block bootstrap: intervals from refits to resampled residuals."""

import logging
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
from pathlib import Path

import numpy as np

from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.output_error.derived import find_quantity
from pneumo_casadi.estimation.statistics import ParameterUncertainty, delta_std, interval_factor
from pneumo_casadi.estimation.uncertainty.added_residuals import shift_measured_flows
from pneumo_casadi.estimation.uncertainty.optimum import Optimum, solve_from
from pneumo_casadi.estimation.uncertainty.replicates import Replicate, ReplicateFolder
from pneumo_casadi.estimation.uncertainty.resampling_plan import ResamplingPlan
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.threads import one_thread

logger = logging.getLogger(__name__)

#: Replicates that one task makes: it writes the problem once.
TASK = 10


class IntervalKind(Enum):
    """How replicates become an interval."""

    PERCENTILE = "quantiles of the replicates"
    STANDARD_ERROR = "estimate and standard deviation of the replicates, as if normal"


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """Refits to resampled residuals.

    Parameters
    ----------
    axis : Axis
        With the estimates from the data.
    uncertainty : ParameterUncertainty
        Covariance by Gauss-Newton; its infinite entries have no interval at all.
    replicates : tuple of Replicate
        All of them, failures included.
    lengths : dict of str to int
        Block length of each record and of the ``"flow map"``, in blocks of the fit and points.
    seed : int
        Of all replicates; each has its own child.
    """

    axis: Axis
    uncertainty: ParameterUncertainty
    replicates: tuple[Replicate, ...]
    lengths: dict[str, int]
    seed: int

    @property
    def failures(self) -> tuple[Replicate, ...]:
        """Replicates that did not converge; no standard deviation or interval counts them."""
        return tuple(r for r in self.replicates if r.status != "converged")

    @property
    def estimates(self) -> FloatArray:
        """Fitted parameters of the replicates that converged, shape (B, n_free)."""
        return np.array([r.values for r in self.replicates if r.status == "converged"])

    def values(self, name: str) -> FloatArray:
        """Return a parameter or derived quantity in each converged replicate, shape (B,)."""
        item, theta = find_quantity(self.axis, name), self.axis.parameters.values
        columns = [self.axis.parameters.index(n) for n in self.uncertainty.names]
        values = []
        for row in self.estimates:
            theta[columns] = row
            values.append(item(theta))
        return np.array(values)

    def informed(self, name: str) -> bool:
        """Tell whether the data inform a quantity, none of its parameters being at a bound.

        Without information refits stay at the start, so that the replicates scatter too little.
        """
        columns = [self.axis.parameters.index(n) for n in self.uncertainty.names]
        gradient = find_quantity(self.axis, name).gradient(self.axis.parameters.values)[columns]
        return bool(np.isfinite(delta_std(gradient, self.uncertainty.covariance)))

    def std(self, name: str) -> float:
        """Return the standard deviation over the replicates; infinite without information."""
        return float(np.std(self.values(name), ddof=1)) if self.informed(name) else float("inf")

    def interval(
        self, name: str, level: float = 0.95, kind: IntervalKind = IntervalKind.PERCENTILE
    ) -> tuple[float, float]:
        """Return an interval at `level`; infinite without information.

        Raises
        ------
        ModelError
            If there are too few replicates for quantiles at that level.
        """
        if not self.informed(name):
            return -np.inf, np.inf
        if kind is IntervalKind.STANDARD_ERROR:
            value = find_quantity(self.axis, name)(self.axis.parameters.values)
            half = interval_factor(level) * self.std(name)
            return value - half, value + half
        values, needed = self.values(name), int(np.ceil(2 / (1 - level)))
        if values.size < needed:
            raise ModelError(
                f"{values.size} replicates are too few for quantiles at {level:g}: at least "
                f"{needed}, better {10 * needed}, or IntervalKind.STANDARD_ERROR"
            )
        low, high = np.quantile(values, [0.5 - level / 2, 0.5 + level / 2])
        return float(low), float(high)


def block_bootstrap(
    optimum: Optimum,
    replicates: int = 200,
    length: float | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    folder: str | Path | None = None,
) -> Bootstrap:
    """Fit again and again to the fitted outputs with resampled residuals.

    Residuals of each record are drawn in blocks that keep their correlation, all channels
    together; those of the flow map likewise, where its coefficients are free. Every refit starts
    at the optimum with the fit's noise.

    Parameters
    ----------
    optimum : Optimum
        The fit and its data.
    replicates : int, optional
        A hundred for standard deviations, a thousand for quantiles.
    length : float, optional
        Of a block of residuals [s]; by default from their autocorrelation (`block_length`), and
        residuals are scaled for the correlation lost at the ends of blocks. With a given length
        they are not.
    seed : int, optional
        Replicate i has the i-th child of this seed, whoever computes it.
    executor : concurrent.futures.Executor, optional
        Runs the refits side by side; processes should be spawned, not forked.
    folder : path, optional
        Every replicate is written there as soon as it is made, and those that are there already
        are read: an interrupted run goes on where it was.

    Returns
    -------
    Bootstrap

    Raises
    ------
    FitError
        If fewer than half of the refits converge; ``.partial`` holds the `Bootstrap`.
    CaseError
        If the folder holds replicates of another bootstrap.
    ModelError
        If fewer than two replicates are asked for.

    Notes
    -----
    The fit sees means over its blocks of samples only, so that residuals of those means are
    drawn: the same as drawing samples in stretches of whole blocks. Residuals are centred, and
    scaled by 1/√(1 - p/b) for what p fitted values have taken out of them, b being the number of
    blocks drawn: correlated noise holds no more independent values than that, and the fit takes
    out of it what is as slow as the motion. Likewise by 1/√k for the correlation that the ends of
    blocks cut, k being the share of a slow sum's variance that survives (`retained_variance`).

    So replicates scatter, on average over the noise, as fits to new noise do, unless noise is so
    slow and the record so short that the fit has taken its slow part altogether. One record
    determines that scatter only to 1/√(2 b): with 10 blocks to 22 %, and intervals are not widened
    for it as those of the robust covariance are. Inputs stay as they were recorded: what a
    controller makes of other noise is not drawn.
    """
    if replicates < 2:
        raise ModelError(f"{replicates} replicates have no scatter; at least 2")
    plan = ResamplingPlan.make(optimum, length, seed)
    store = None if folder is None else ReplicateFolder(Path(folder), plan.fingerprint(optimum))
    done = {} if store is None else {i: r for i in range(replicates) if (r := store.read(i))}
    missing = [i for i in range(replicates) if i not in done]
    tasks = [missing[i : i + TASK] for i in range(0, len(missing), TASK)]
    run = map if executor is None else executor.map
    refits: Iterable[list[Replicate]] = run(partial(_refits, optimum, plan, store), tasks)
    done |= {replicate.index: replicate for part in refits for replicate in part}
    records = [record.name for record in optimum.records]
    result = Bootstrap(
        optimum.result.axis,
        optimum.result.uncertainty,
        tuple(done[i] for i in range(replicates)),
        dict(zip([*records, "flow map"], plan.lengths, strict=False)),
        seed,
    )
    if result.failures:
        text = f"{len(result.failures)} of {replicates} refits failed, the first with: "
        logger.warning("bootstrap: %s", text + result.failures[0].status)
        if 2 * len(result.failures) > replicates:
            raise FitError(f"bootstrap: {text}{result.failures[0].status}", result)
    return result


def _refits(
    optimum: Optimum, plan: ResamplingPlan, store: ReplicateFolder | None, indices: Sequence[int]
) -> list[Replicate]:
    made = []
    for index in indices:
        replicate = _refit(optimum, plan, index)
        if store is not None:
            store.write(replicate)
        made.append(replicate)
    return made


@one_thread
def _refit(optimum: Optimum, plan: ResamplingPlan, index: int) -> Replicate:
    problem, result = optimum.problem, optimum.result
    drawn = plan.draw_residuals(index)
    segments, used = [], [0] * len(drawn)
    for segment, fitted in zip(problem.segments, result.fitted, strict=True):
        first = used[segment.record]
        used[segment.record] += segment.K
        e = drawn[segment.record][:, first : first + segment.K]
        segments.append(replace(segment, y=fitted + e))
    anchor = problem.anchor
    if anchor is not None:
        # Prior knowledge is drawn anew too: another laboratory had measured other areas.
        points = [drawn[-1][0]] if anchor.n_points else []
        at_fit = problem.anchor_residuals(optimum.point.theta)
        shift = np.concatenate([*points, plan.draw_prior(index, anchor.n_prior)]) - at_fit
        anchor = shift_measured_flows(anchor, shift)
    synthetic = replace(problem, segments=tuple(segments), anchor=anchor)
    solution = solve_from(optimum, synthetic, optimum.point)
    values = solution.point.theta[optimum.columns]
    return Replicate(
        index,
        solution.status,
        optimum.cost(synthetic, solution),
        solution.iterations,
        tuple(map(float, values)),
    )
