"""What a fit to an experiment would say, before the experiment: covariance and confusions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pneumo_casadi.design.experiment import SimulatedExperiment
from pneumo_casadi.estimation.flow_anchor import Anchor, anchor_flow, anchor_to_flow_map
from pneumo_casadi.estimation.output_error.information import gauss_newton_information
from pneumo_casadi.estimation.output_error.shooting.condensing import (
    Linearised,
    condense,
    linearise,
)
from pneumo_casadi.estimation.output_error.shooting.interval import IntervalFunctions
from pneumo_casadi.estimation.output_error.shooting.problem import Problem, Unknowns
from pneumo_casadi.estimation.output_error.shooting.segments import Segment
from pneumo_casadi.estimation.output_error.solvers.condensed_step import (
    TRUST,
    apply_step,
    condensed_step,
)
from pneumo_casadi.estimation.output_error.solvers.multiple_shooting import solve_gauss_newton
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.sampled_axis import SampledAxis
from pneumo_casadi.model.stepping import stepping_for
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.valve import FlowMap

#: Length of the blocks that are compared, and of the intervals simulated side by side [s].
BLOCK, INTERVAL = 2e-3, 0.1
#: At most so many linearisations for a projection, until it changes by no more than this share.
SWEEPS, SETTLED = 12, 0.03


@dataclass(frozen=True, eq=False)
class Fit:
    """The output-error fit that will be made of an experiment, before there is one.

    Parameters
    ----------
    axis : Axis
        The model that will be fitted, at the values where its outputs are linearised or its
        refit starts.
    dt : float
        Sampling period [s].
    sigma : (ny,) array
        Noise of one sample of each output [Pa, Pa, m].
    flow_map : FlowMap or None
        Metered map that anchors the free coefficients of the flow.
    """

    axis: Axis
    dt: float
    sigma: FloatArray
    flow_map: FlowMap | None

    @cached_property
    def model(self) -> SampledAxis:
        """The axis with inputs as recorded."""
        plain = self.axis.at_null_values()
        return SampledAxis(self.axis, stepping_for(self.axis, self.dt, also=(plain,)))

    @cached_property
    def functions(self) -> IntervalFunctions:
        """The compiled interval with its sensitivities S = ∂x/∂(x_0, θ)."""
        n = max(1, round(BLOCK / self.dt))
        blocks = max(1, round(INTERVAL / (n * self.dt)))
        return IntervalFunctions(self.model, n, blocks, self.axis.parameters.free_names)

    @cached_property
    def anchor(self) -> Anchor | None:
        """What fixes the scale of the flows; None if the coefficients are fixed."""
        anchor = anchor_flow(self.axis, self.flow_map)
        if anchor is None:
            return None
        return anchor if set(anchor.names) & set(self.axis.parameters.free_names) else None

    def problem(self, experiments: Sequence[SimulatedExperiment]) -> tuple[Problem, Unknowns]:
        """Return the problem of fitting experiments without noise, and where it starts.

        Nodes start on the simulated states; effects that the experiments' axis has not, at rest.
        """
        segments = tuple(self._segment(i, experiment) for i, experiment in enumerate(experiments))
        own = self.axis.parameters
        problem = Problem(self.model, own, segments, self.functions, self.anchor)
        return problem, problem.start()

    def _segment(self, number: int, run: SimulatedExperiment) -> Segment:
        n, per = self.functions.n, self.functions.blocks
        K = run.u.shape[1] // n
        y = run.y[:, : K * n].reshape(len(run.y), K, n).mean(axis=2)
        at = slice(0, K * n, per * n)
        names = self.axis.states
        nodes = run.x[: len(self.axis.motion_states), at]
        if names != self.axis.motion_states:
            values = self.axis.parameters.values
            full = self.axis.rest.map(nodes.shape[1])(nodes, run.u[:, at], values[:, None])
            nodes = np.asarray(full, dtype=float)
        return Segment(number, 0, n, per, run.u[:, : K * n], y, nodes)


def information_of(fit: Fit, experiments: Sequence[SimulatedExperiment]) -> FloatArray:
    """Return the information on the scaled free parameters, initial states eliminated.

    One linearisation of the simulated record gives it; the flow map counts once.

    Parameters
    ----------
    experiments : sequence of SimulatedExperiment
        Done by the fit's own axis, fitted together.
    """
    problem, point = fit.problem(experiments)
    return gauss_newton_information(problem, point, fit.sigma).matrix


@dataclass(frozen=True, slots=True)
class Refit:
    """The fit of a model to an experiment simulated with another model.

    Parameters
    ----------
    distance : float
        √(Σ ((y_A − y_B)/σ)² + the map's residuals), the least over initial state, nominal
        parameters, flow map and B's own: in standard deviations of one sample, so that half its
        square is the difference of their log-likelihoods. Infinite where B diverged.
    theta : (n,) array
        All parameters of B there.
    """

    distance: float
    theta: FloatArray


def refit(fit: Fit, run: SimulatedExperiment, theta: FloatArray | None = None) -> Refit:
    """Fit model B to what model A did, without noise, to the end.

    The flow map is metered on A as well: give the fit a map without noise, from `noise_free_map`.

    Parameters
    ----------
    fit : Fit
        Model B.
    run : SimulatedExperiment
        An experiment on model A.
    theta : (n,) array, optional
        Start; by default the values of the fit's axis.
    """
    problem, point = fit.problem([run])
    if theta is not None:
        point = Unknowns(theta.copy(), point.x)
    with np.errstate(all="ignore"):  # trial steps that diverge are found and shortened
        solution = solve_gauss_newton(problem, point, fit.sigma, False)
        cost = problem.cost(solution.point.theta, solution.m, fit.sigma)
    distance = float(np.sqrt(2 * cost)) if np.isfinite(cost) else float("inf")
    return Refit(distance, solution.point.theta)


def project_refit(fit: Fit, run: SimulatedExperiment, theta: FloatArray) -> Refit:
    """Return the refit to first order about the nearest of a few full steps.

    The nodes start on the trajectory of A, so that no open loop can drift. The remaining
    difference of the outputs is projected onto the orthogonal complement of all free unknowns.
    Each sweep computes the sensitivities once; the sweeps end when two projections agree.

    Parameters
    ----------
    fit, run
        Model B and an experiment on model A, as for `refit`.
    theta : (n,) array
        Start: the refit of another experiment.

    Returns
    -------
    Refit
        With infinite distance where B diverged or the projections did not converge: a projection
        far from the optimum overestimates the distance and would mislead a search.
    """
    problem, point = fit.problem([run])
    point = Unknowns(theta.copy(), point.x)
    last = float("inf")
    with np.errstate(all="ignore"):
        for _ in range(SWEEPS):
            at = linearise(problem, point, fit.sigma)
            step = condensed_step(problem, at, point, fit.sigma) if at.finite else None
            if step is None:
                return Refit(float("inf"), theta)
            square = _closed_square(problem, at, point, fit.sigma) - 2 * step.gain
            distance = float(np.sqrt(max(0.0, square)))
            # Steps limited by the trust box may agree although the projection has not converged.
            whole = float(np.abs(step.theta).max(initial=0.0)) < 0.99 * TRUST
            settled = whole and abs(distance - last) <= SETTLED * last
            last = distance
            point = apply_step(problem, point, step)
            if settled:
                return Refit(distance, point.theta)
    return Refit(float("inf"), theta)


def _closed_square(problem: Problem, at: Linearised, point: Unknowns, sigma: FloatArray) -> float:
    """Return the sum of squares with the defects closed to first order, nothing else moved."""
    closing = sum(segment.closing for segment in condense(problem, at, sigma))
    return 2 * problem.cost(point.theta, at.m, sigma) + closing


def noise_free_map(axis: Axis, table: FlowMap) -> FlowMap:
    """Return a metered map as the axis would have it, without noise, at the same points."""
    c = axis.parameters.select(axis.flow.parameters.names).values
    return replace(table, q_m=table.q_m + anchor_to_flow_map(table, axis.flow, sigma=1.0)(c))
