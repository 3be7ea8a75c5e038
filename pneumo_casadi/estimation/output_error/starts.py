"""Points at which an output-error problem begins: as measured, or on a simulation.

From measured states full steps first close the defects between the intervals. Where the parameters
are nearly right, a simulation from estimated initial states is much nearer to the optimum: measured
velocities of an axis that sticks lead full steps astray.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pneumo_casadi.errors import FitError
from pneumo_casadi.estimation.output_error.initial_states import settle_initial_states
from pneumo_casadi.estimation.output_error.shooting.interval import IntervalFunctions
from pneumo_casadi.estimation.output_error.shooting.problem import (
    Problem,
    Unknowns,
    shoot_segments,
)
from pneumo_casadi.estimation.output_error.shooting.segments import Segment
from pneumo_casadi.parameters import FloatArray

#: Gives the start of a problem, from its parameters (n,) and the stated noise (ny,).
Begin = Callable[[Problem, FloatArray, FloatArray], Unknowns]
#: Beginning of a segment from which its initial state is estimated [s].
HEAD = 0.5


def measured_start(problem: Problem, theta: FloatArray, sigma: FloatArray) -> Unknowns:
    """Begin at states from smoothed measurements."""
    return Unknowns(theta, problem.start().x)


def settled_start(problem: Problem, theta: FloatArray, sigma: FloatArray) -> Unknowns:
    """Begin on simulations from initial states that fit the first `HEAD` seconds best."""
    model, functions = problem.model, problem.functions
    if model.controller is not None:  # in its loop no trajectory drifts away
        return measured_start(problem, theta, sigma)
    head = max(1, round(HEAD / (functions.n * model.stepping.dt)))
    parameters = problem.parameters.with_values(theta).fix_all()
    states = IntervalFunctions(model, functions.n, functions.blocks, ())
    x_0 = np.stack([segment.x[:, 0] for segment in problem.segments], axis=1)
    lengths = np.array([min(head, segment.K) for segment in problem.segments])
    for K in np.unique(lengths):  # problems side by side are of one length
        at = np.flatnonzero(lengths == K)
        cut = tuple(_beginning(problem.segments[i], int(K)) for i in at)
        beginnings = Problem(model, parameters, cut, states, None)
        try:
            x_0[:, at] = settle_initial_states(beginnings, sigma, "beginnings")
        except FitError:  # full steps may close from measured states what no simulation bears
            return measured_start(problem, theta, sigma)
    return _simulated(problem, theta, sigma, x_0)


def known_start(states: Sequence[FloatArray]) -> Begin:
    """Return what begins on simulations from given initial states, one a segment."""

    def begin(problem: Problem, theta: FloatArray, sigma: FloatArray) -> Unknowns:
        x_0 = np.stack([segment.x[:, 0] for segment in problem.segments], axis=1)
        if len(states) == x_0.shape[1]:
            given = np.stack(list(states), axis=1)
            x_0[: len(given)] = given
        return _simulated(problem, theta, sigma, x_0)

    return begin


def _beginning(segment: Segment, K: int) -> Segment:
    nodes = segment.x[:, : -(-K // segment.per)]
    return replace(segment, w=segment.w[:, : K * segment.n], y=segment.y[:, :K], x=nodes)


def _simulated(problem: Problem, theta: FloatArray, sigma: FloatArray, x_0: FloatArray) -> Unknowns:
    nodes, m = shoot_segments(problem, theta, x_0)
    if np.isfinite(nodes).all() and np.isfinite(m).all():
        return Unknowns(theta, nodes)
    return measured_start(problem, theta, sigma)
