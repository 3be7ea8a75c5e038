"""An experiment that distinguishes effects."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations

import numpy as np

from pneumo_casadi.design.experiment import ExperimentSimulator, SimulatedExperiment
from pneumo_casadi.design.options import (
    DesignOptions,
    SimulationRate,
    feasible_finalists,
    resample_reference,
    simulation_rates,
)
from pneumo_casadi.design.prediction import Fit, Refit, noise_free_map, project_refit, refit
from pneumo_casadi.design.reference import Reference
from pneumo_casadi.design.result import Design, Distance
from pneumo_casadi.design.search import search
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.progress import Progress, no_progress
from pneumo_casadi.runtime.threads import one_thread
from pneumo_casadi.valve import FlowMap

#: Below this refitted distance from the nominal axis under a reference with all kinds of motion
#: an effect counts as absorbed: no sample shows it.
VISIBLE_DISTANCE = 1.0


@dataclass(frozen=True, eq=False)
class EffectPair:
    """An effect that is there, and one that is fitted instead.

    Parameters
    ----------
    truth, fitted : str
        Their names.
    simulator : ExperimentSimulator
        The axis with the first, in its loop.
    fit : Fit
        The axis with the second.
    """

    truth: str
    fitted: str
    simulator: ExperimentSimulator
    fit: Fit

    def refit(self, reference: Reference, theta: FloatArray | None = None) -> Refit:
        """Return the refit to the end under a reference; the better of two starts, if two."""
        run = self.simulator(reference)
        first = refit(self.fit, run)
        if theta is None:
            return first
        return min(first, refit(self.fit, run, theta), key=lambda refitted: refitted.distance)


@dataclass(frozen=True, eq=False)
class SeparationProblem:
    """Effects to be told apart.

    Parameters
    ----------
    axes : mapping of str to Axis
        The axis with each of the effects, at the size at which they are to be told apart. One
        of them may be the nominal axis: everything that it does the others can do as well, so
        that it is only ever fitted.
    nominal : Axis
        The axis without effects.
    flow_map : FlowMap
        Metered map.
    clock : Clock
        How finely to simulate.
    """

    axes: Mapping[str, Axis]
    nominal: Axis
    flow_map: FlowMap | None
    clock: SimulationRate

    @cached_property
    def pairs(self) -> tuple[EffectPair, ...]:
        """All ordered pairs whose first has an effect."""
        return tuple(
            self._pair(truth, fitted, self.axes[fitted])
            for truth, fitted in permutations(self.axes, 2)
            if self.axes[truth].effects
        )

    def _pair(self, truth: str, fitted: str, model: Axis) -> EffectPair:
        smoothed = self.clock.smoothed(self.axes[truth])
        table = None if self.flow_map is None else noise_free_map(smoothed, self.flow_map)
        fit = Fit(self.clock.smoothed(model), self.clock.dt, self.clock.sigma, table)
        return EffectPair(truth, fitted, ExperimentSimulator(smoothed, self.clock.dt), fit)

    def shown(self, reference: Reference) -> frozenset[str]:
        """Return the effects that the nominal parameters do not absorb under a reference."""
        names = set()
        for name, axis in self.axes.items():
            if axis.effects:
                pair = self._pair(name, "nominal", self.nominal)
                if pair.refit(reference).distance > VISIBLE_DISTANCE:
                    names.add(name)
        return frozenset(names)


@one_thread
def design_to_separate(
    axes: Mapping[str, Axis],
    nominal: Axis,
    recorded: Sequence[Reference],
    flow_map: FlowMap | None,
    sigma: FloatArray,
    options: DesignOptions,
    progress: Progress | None = None,
) -> Design:
    """Design an experiment that distinguishes effects.

    The smallest refitted distance of all ordered pairs is made large: the norm of the difference
    between what the axis with one effect does and what the axis with another can be fitted to,
    initial state, nominal parameters, flow map (anchored) and the other effect's own parameters
    all free, in standard deviations of the measurement. The search uses projections
    with sensitivities at the refit of the recorded experiment; the distances in the result are
    refitted.

    Parameters
    ----------
    axes : mapping of str to Axis
        Two or more axes by the name of their effect, at the sizes to be told apart; one of them
        may be the nominal one.
    nominal : Axis
        The axis without effects.
    recorded : sequence of Reference
        What the axis was given so far; the first one counts for comparison.
    flow_map, sigma, options, progress
        As for `design_for_precision`.

    Returns
    -------
    Design

    Raises
    ------
    ModelError
        If the nominal parameters absorb all effects whatever the axis does.
    FitError
        If no reference tried keeps the limits.
    """
    began, report = time.perf_counter(), progress or no_progress
    if len(axes) < 2:
        raise ModelError("design: name two or more effects to tell apart")
    fine, coarse = simulation_rates(nominal, sigma)
    problem = SeparationProblem(axes, nominal, flow_map, coarse)
    before = resample_reference(recorded[0], coarse.dt)
    report("writing and compiling", 0.0)
    shown = problem.shown(_all_kinds(options, coarse.dt))
    if not shown:
        raise ModelError(
            f"design: the nominal parameters absorb {', '.join(axes)} whatever the axis does; "
            "hold the parameters that absorb them at known values (weigh the mass, turn the axis)"
        )
    report("refitting the recorded experiment", 0.1)
    old = {pair: pair.refit(before) for pair in problem.pairs}
    visible = [pair for pair in problem.pairs if pair.truth in shown]

    # Projections go on from the best reference so far, from which most others are not far.
    near = {pair: old[pair] for pair in visible}
    most = [0.0]

    def evaluate(z: FloatArray) -> tuple[float, float]:
        reference = options.make_reference(options.space.parts(z), coarse.dt)
        runs: dict[str, SimulatedExperiment] = {}
        for pair in problem.pairs:
            if pair.truth not in runs:
                runs[pair.truth] = pair.simulator(reference)
        excess = max(run.excess(options.search_limits) for run in runs.values())
        if excess:
            return excess, float("inf")
        new = {
            pair: project_refit(pair.fit, runs[pair.truth], near[pair].theta) for pair in visible
        }
        least = min(refitted.distance for refitted in new.values())
        if not np.isfinite(least):
            return 0.0, float("inf")
        if least > most[0]:
            most[0] = least
            near.update(new)
        return 0.0, -float(np.log(max(least, 1e-12)))

    outcome = search(
        evaluate, options.space, options.evaluations, options.seed,
        lambda text, s: report(text, 0.2 + 0.6 * s),
    )  # fmt: skip
    report("refitting the best", 0.8)
    judged = []
    for candidate, runs in feasible_finalists(outcome, options, axes, fine):
        reference = options.make_reference(options.space.parts(candidate.z), coarse.dt)
        new = {pair: pair.refit(reference, old[pair].theta).distance for pair in problem.pairs}
        judged.append((min(new[pair] for pair in visible), candidate, runs, new))
    _, best, runs, new = max(judged, key=lambda item: item[0])
    reference = next(iter(runs.values())).reference
    samples = len(sigma) * reference.x_ref.size
    report("done", 1.0)
    return Design(
        reference,
        options.space.parts(best.z),
        options,
        runs,
        outcome.history,
        None,
        tuple(
            Distance(
                pair.truth, pair.fitted, old[pair].distance, new[pair], samples,
                pair.truth not in shown,
            )
            for pair in problem.pairs
        ),
        time.perf_counter() - began,
    )  # fmt: skip


def _all_kinds(options: DesignOptions, dt: float) -> Reference:
    """Return a reference with all kinds of motion, and steps of the common mode if allowed."""
    space = options.space
    z = space.point(dict.fromkeys(space.kinds, 1.0))
    if space.common:
        z[space.names.index("common_mode_steps.step")] = 0.5
    return options.make_reference(space.parts(z), dt)
