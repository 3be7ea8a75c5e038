"""Many starts: the same fit begun elsewhere, every start's cost on record."""

import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from pneumo_casadi.data import Recording
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.output_error.fit import fit_output_error
from pneumo_casadi.estimation.output_error.options import OutputErrorOptions
from pneumo_casadi.estimation.output_error.result import OutputErrorResult
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import Parameters
from pneumo_casadi.valve import AnyFlowMap

#: Costs that differ by less than this share are the same optimum.
SAME = 1e-4


@dataclass(frozen=True, eq=False)
class StartOutcome:
    """Result of one start.

    Parameters
    ----------
    start : Parameters
        Where it began.
    status : str
        ``"converged"``, or why not.
    cost : float
        ½ Σ (residual/σ)² with the stated σ, the same for all starts; infinite where it failed.
    seconds : float
        Time it took.
    result : OutputErrorResult or None
        None where it failed.
    """

    start: Parameters
    status: str
    cost: float
    seconds: float
    result: OutputErrorResult | None


@dataclass(frozen=True, eq=False)
class MultiStart:
    """All outcomes, in the order of the draws; the first started where the axis stood."""

    outcomes: tuple[StartOutcome, ...]

    @property
    def best(self) -> OutputErrorResult:
        """Result of the lowest cost."""
        best = min(self.outcomes, key=lambda outcome: outcome.cost)
        if best.result is None:
            raise FitError(f"none of {len(self.outcomes)} starts converged: {best.status}", None)
        return best.result

    @property
    def agreeing(self) -> int:
        """Number of starts that reached the lowest cost."""
        least = min(outcome.cost for outcome in self.outcomes)
        if not np.isfinite(least):
            return 0
        return sum(outcome.cost <= least * (1 + SAME) for outcome in self.outcomes)


def fit_from_many_starts(
    axis: Axis,
    records: Sequence[Recording],
    flow_map: AnyFlowMap | None = None,
    options: OutputErrorOptions | None = None,
    starts: int = 8,
    spread: float = 0.5,
    seed: int = 0,
    executor: Executor | None = None,
) -> MultiStart:
    """Fit from the axis' own parameters and from others drawn around them.

    Parameters
    ----------
    axis, records, flow_map, options
        As for `fit_output_error`.
    starts : int
        Number of starts, the axis' own included.
    spread : float
        Every free parameter is multiplied by a factor drawn evenly from 1 ± spread, within its
        bounds; one that is zero is drawn from ± spread of its scale.
    seed : int
        Of the draws.
    executor : concurrent.futures.Executor, optional
        Runs the fits side by side; processes, because IPOPT and threads do not go together.

    Returns
    -------
    MultiStart

    Raises
    ------
    ModelError
        If no start is asked for, or the problem is not well posed.
    """
    if starts < 1:
        raise ModelError(f"{starts} starts: at least one is needed")
    rng = np.random.default_rng(seed)
    begins = [
        axis.parameters,
        *(draw_parameters(axis.parameters, spread, rng) for _ in range(starts - 1)),
    ]
    run = partial(_outcome, axis, tuple(records), flow_map, options)
    mapped = map(run, begins) if executor is None else executor.map(run, begins)
    return MultiStart(tuple(mapped))


def draw_parameters(parameters: Parameters, spread: float, rng: np.random.Generator) -> Parameters:
    """Return parameters with every free one moved at random, see `fit_from_many_starts`."""
    mask, values = parameters.free_mask, parameters.values
    factor = rng.uniform(-spread, spread, values.size)
    size = np.where(values != 0, values, parameters.scales)
    moved = np.clip(values + np.where(mask, factor * size, 0), parameters.lower, parameters.upper)
    return parameters.with_values(moved)


def _outcome(
    axis: Axis,
    records: tuple[Recording, ...],
    flow_map: AnyFlowMap | None,
    options: OutputErrorOptions | None,
    start: Parameters,
) -> StartOutcome:
    began = time.perf_counter()
    try:
        result = fit_output_error(axis.with_parameters(start), records, flow_map, options)
    except (FitError, ModelError) as error:
        return StartOutcome(start, str(error), float("inf"), time.perf_counter() - began, None)
    seconds = time.perf_counter() - began
    return StartOutcome(start, result.status, result.stages[-1].cost, seconds, result)
