"""An experiment for small standard errors."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneumo_casadi.design.criterion import Criterion
from pneumo_casadi.design.experiment import ExperimentSimulator, SimulatedExperiment
from pneumo_casadi.design.options import (
    DesignOptions,
    SimulationRate,
    feasible_finalists,
    resample_reference,
    simulation_rates,
)
from pneumo_casadi.design.prediction import Fit, information_of
from pneumo_casadi.design.reference import Reference
from pneumo_casadi.design.result import Design, Precision
from pneumo_casadi.design.search import search
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.output_error.information import held_by_bounds
from pneumo_casadi.estimation.statistics import invert_information
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.progress import Progress, no_progress
from pneumo_casadi.runtime.threads import one_thread
from pneumo_casadi.valve import FlowMap


@dataclass(frozen=True, eq=False)
class PrecisionForecast:
    """Standard errors of the parameters of interest, before an experiment is made.

    Parameters
    ----------
    axis : Axis
        At its estimate.
    flow_map : FlowMap
        Its metered map.
    clock : Clock
        How finely to simulate.
    names : tuple of str
        Parameters of interest; what else is free is estimated with them.
    """

    axis: Axis
    flow_map: FlowMap | None
    clock: SimulationRate
    names: tuple[str, ...]

    @cached_property
    def simulator(self) -> ExperimentSimulator:
        """The axis in its loop."""
        return ExperimentSimulator(self.clock.smoothed(self.axis), self.clock.dt)

    @cached_property
    def fit(self) -> Fit:
        """The fit that will be made."""
        return Fit(self.simulator.axis, self.clock.dt, self.clock.sigma, self.flow_map)

    @cached_property
    def at_bound(self) -> tuple[str, ...]:
        """Parameters held by a bound at the estimate: a fit counts them as known."""
        return free_held_by_bounds(self.axis)

    def run(self, reference: Reference) -> SimulatedExperiment:
        """Simulate a reference at the forecast's own rate."""
        return self.simulator(resample_reference(reference, self.clock.dt))

    def covariance(self, runs: Sequence[SimulatedExperiment]) -> FloatArray:
        """Return the covariance of the parameters of interest [SI], fitted to all runs together.

        Infinite where nothing informs one of them.
        """
        parameters = self.axis.parameters
        scales = parameters.scales[parameters.free_mask]
        information = information_of(self.fit, runs)
        inversion = invert_information(information, scales, parameters.free_names, self.at_bound)
        at = [parameters.free_names.index(name) for name in self.names]
        return inversion.covariance[np.ix_(at, at)]

    def size(self, covariance: FloatArray, criterion: Criterion) -> float:
        """Return the criterion of a covariance in shares of the parameters' values."""
        chosen = self.axis.parameters.select(self.names)
        unit = np.where(chosen.values == 0, chosen.scales, np.abs(chosen.values))
        return criterion.of(covariance / np.outer(unit, unit))


def free_held_by_bounds(axis: Axis) -> tuple[str, ...]:
    """Return the free parameters that a bound holds at the estimate."""
    return held_by_bounds(axis.parameters.select(axis.parameters.free_names))


def parameters_of_interest(axis: Axis) -> tuple[str, ...]:
    """Return the free parameters without those of the flow map, and those held by a bound."""
    left_out = {*axis.flow_parameters, *free_held_by_bounds(axis)}
    return tuple(name for name in axis.parameters.free_names if name not in left_out)


@one_thread
def design_for_precision(
    axis: Axis,
    recorded: Sequence[Reference],
    flow_map: FlowMap | None,
    sigma: FloatArray,
    options: DesignOptions,
    criterion: Criterion = Criterion.D,
    names: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> Design:
    """Design an experiment that makes the standard errors of an output-error fit small.

    Parameters
    ----------
    axis : Axis
        At its estimate; what is free there will be fitted.
    recorded : sequence of Reference
        What the axis was given so far, for comparison.
    flow_map : FlowMap
        Its metered map, the anchor of the flow's coefficients.
    sigma : (3,) array
        Noise of one sample of p_P, p_N [Pa] and x [m].
    options : DesignOptions
        Limits, duration, kinds of motion, length of the search.
    criterion : Criterion, optional
        D, A or E.
    names : sequence of str, optional
        Parameters of interest; by default all free ones but the coefficients of the flow, and
        those held by a bound, which a fit counts as known.
    progress : callable, optional
        Called as ``progress(text, share)``.

    Returns
    -------
    Design

    Raises
    ------
    FitError
        If no reference tried keeps the limits and determines what is asked for.
    ModelError
        If a name is not free, or held by a bound, or if the recorded reference leaves the finite
        numbers.
    """
    began, report = time.perf_counter(), progress or no_progress
    chosen = tuple(names) if names is not None else parameters_of_interest(axis)
    unknown = sorted(set(chosen) - set(axis.parameters.free_names))
    if unknown or not chosen:
        raise ModelError(
            f"design: {', '.join(unknown)} is not fitted"
            if unknown
            else "design: no parameter is left to aim at; release some, or those that a bound holds"
        )
    bound = [name for name in chosen if name in free_held_by_bounds(axis)]
    if bound:
        raise ModelError(f"design: {', '.join(bound)} is held by a bound, and no record tells it")
    fine, coarse = (
        PrecisionForecast(axis, flow_map, clock, chosen) for clock in simulation_rates(axis, sigma)
    )
    space = options.space

    def evaluate(z: FloatArray) -> tuple[float, float]:
        run = coarse.run(options.make_reference(space.parts(z), coarse.clock.dt))
        excess = run.excess(options.search_limits)
        if excess:
            return excess, float("inf")
        size = coarse.size(coarse.covariance([run]), criterion)
        return 0.0, float(np.log(size)) if size > 0 else float("inf")

    report("writing and compiling", 0.0)
    outcome = search(
        evaluate, space, options.evaluations, options.seed, lambda text, s: report(text, 0.9 * s)
    )
    report("judging the best", 0.9)
    judged = []
    for candidate, runs in feasible_finalists(outcome, options, {"": axis}, fine.clock):
        covariance = fine.covariance([runs[""]])
        judged.append((fine.size(covariance, criterion), candidate, runs, covariance))
    after, best, runs, designed = min(judged, key=lambda item: item[0])
    before = [fine.run(reference) for reference in recorded]
    now, both = fine.covariance(before), fine.covariance([*before, runs[""]])
    interest = axis.parameters.select(chosen)
    report("done", 1.0)
    return Design(
        runs[""].reference,
        space.parts(best.z),
        options,
        {"nominal": runs[""]},
        outcome.history,
        Precision(
            chosen,
            tuple(item.unit for item in interest),
            interest.values,
            np.sqrt(np.diag(now)),
            np.sqrt(np.diag(designed)),
            np.sqrt(np.diag(both)),
            criterion,
            fine.size(now, criterion),
            after,
            fine.size(both, criterion),
        ),
        (),
        time.perf_counter() - began,
    )
