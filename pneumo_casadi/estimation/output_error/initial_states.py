"""Initial states of a record or of its windows, all parameters known."""

from dataclasses import replace

import numpy as np

from pneumo_casadi.data import Recording
from pneumo_casadi.errors import FitError
from pneumo_casadi.estimation.equation_error.driven_states import states_along
from pneumo_casadi.estimation.gauss_newton import Damping
from pneumo_casadi.estimation.output_error.shooting.condensing import (
    condense,
    shoot_and_linearise,
)
from pneumo_casadi.estimation.output_error.shooting.interval import IntervalFunctions
from pneumo_casadi.estimation.output_error.shooting.problem import Problem
from pneumo_casadi.estimation.output_error.shooting.segments import cut_segments
from pneumo_casadi.estimation.statistics import stated_or_estimated_noise
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.integration import sample_lengths
from pneumo_casadi.model.sampled_axis import SampledAxis
from pneumo_casadi.model.stepping import ACCURATE, stepping_for
from pneumo_casadi.parameters import FloatArray

#: Length of the blocks whose mean outputs are compared [s].
BLOCK = 2e-3
#: Length of the intervals that are simulated side by side [s].
INTERVAL = 0.1
#: Damped Gauss-Newton iterations; a window that sticks needs a dozen.
ITERATIONS = 15
#: Relative decrease of a window's cost below which it has settled; beside a play, steps that gain
#: ten times as much may still precede long ones.
SETTLED = 1e-3
#: Damping up to which a step is nearly the undamped one: only such a step can tell.
NEARLY_FULL = 1.0
#: Share of its windows still at work below which a problem is written anew for these alone.
SHRUNK = 0.9
#: Any step that lowers the cost of a window is accepted.
DAMPING = Damping(start=0.1, accept=0.0, trust=0.0, fall=5.0, grow=10.0, most=1e8)


def estimate_initial_states(
    axis: Axis,
    record: Recording,
    window: float | None = None,
    longest_step: float = ACCURATE,
    apart: float | None = None,
) -> tuple[tuple[int, FloatArray], ...]:
    """Estimate the state at the start of a record, or of each whole window, by output error.

    Every window is a least-squares problem of its own in its initial state, solved by damped
    Gauss-Newton steps. All windows are simulated side by side, which is why the loop of
    `estimation.gauss_newton` is written here for arrays of problems.

    Parameters
    ----------
    axis : Axis
        With known parameters.
    record : Recording
        Measured inputs and outputs.
    window : float, optional
        Length of the windows [s]; None for the whole record.
    longest_step : float, optional
        See `substeps_for`.
    apart : float, optional
        From the beginning of a window to that of the next [s]; by default windows follow each
        other.

    Returns
    -------
    tuple of (int, (nx,) array)
        First sample and state of each window.

    Raises
    ------
    FitError
        If a window's simulation leaves the finite numbers already at the measured state.
    """
    lengths = sample_lengths(record, record.dt)
    stepping = stepping_for(axis, record.dt, record.hold, lengths, longest_step)
    problem = _problem(SampledAxis(axis, stepping), record, window, apart)
    sigma = np.array([stated_or_estimated_noise(axis.bench, [record], c) for c in axis.outputs])
    x_0 = settle_initial_states(problem, sigma, record.name)
    return tuple((segment.first, x_0[:, i]) for i, segment in enumerate(problem.segments))


def settle_initial_states(problem: Problem, sigma: FloatArray, name: str) -> FloatArray:
    """Return the initial states that fit segments of one length best, (nx, segments).

    Parameters
    ----------
    problem : Problem
        Without free parameters and without a flow map.
    sigma : (ny,) array
        Noise of one sample of each output.
    name : str
        What the data are called where no simulation is possible.

    Raises
    ------
    FitError
        If the simulation of a segment leaves the finite numbers already at the measured state.
    """
    segments = problem.segments
    x_0 = np.stack([segment.x[:, 0] for segment in segments], axis=1)
    cost, H, g = _expanded(problem, x_0, sigma)
    if not np.isfinite(cost).all():
        start = segments[int(np.argmin(np.isfinite(cost)))].first * problem.model.stepping.dt
        raise FitError(f"{name}: no simulation from the measured state at t = {start:g} s")
    damping = np.full(cost.size, DAMPING.start)
    active = np.ones(cost.size, dtype=bool)
    at = np.arange(cost.size)  # the windows of `problem`
    for _ in range(ITERATIONS):
        step = _damped_steps(H[at], g[at], damping[at]) * problem.axis.state_scales[:, None]
        ahead = x_0[:, at] + np.where(active[at], step, 0.0)
        new, *expansion = _expanded(problem, ahead, sigma)
        better = new < cost[at]
        small = better & (cost[at] - new < SETTLED * cost[at]) & (damping[at] <= NEARLY_FULL)
        x_0[:, at[better]] = ahead[:, better]
        cost[at[better]] = new[better]
        H[at[better]], g[at[better]] = (part[better] for part in expansion)
        damping[at] = DAMPING.after(damping[at], np.where(better, 1.0, -1.0))
        active[at] &= ~small & (damping[at] < DAMPING.most)
        if not active.any():
            break
        if np.count_nonzero(active) < SHRUNK * at.size:  # some stick, most settle at once
            at = np.flatnonzero(active)
            problem = replace(problem, segments=tuple(segments[i] for i in at))
    return x_0


def _problem(
    model: SampledAxis, record: Recording, window: float | None, apart: float | None = None
) -> Problem:
    axis = model.axis
    n = max(1, round(BLOCK / record.dt))
    # What an effect remembers from before a window, no step within it brings back.
    driven = states_along(axis, [record]) if window is not None else ()
    segments = cut_segments(model, [record], n, window, INTERVAL, driven, apart)
    whole = tuple(segment for segment in segments if segment.K == segments[0].K)
    functions = IntervalFunctions(model, n, whole[0].per, ())
    return Problem(model, axis.parameters.fix_all(), whole, functions, None)


def _expanded(
    problem: Problem, x_0: FloatArray, sigma: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the cost of each window (B,), JᵀJ (B, nx, nx) and Jᵀr (B, nx), x_0 scaled.

    A cost is infinite where a simulation is not finite. Sensitivities run along with every
    trial: most are accepted, and a function of values alone would have to be compiled besides.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # a trial may run away: then it costs inf
        at = shoot_and_linearise(problem, problem.parameters.values, x_0, sigma)
        squares = ((problem.y - at.m) / sigma[:, None]) ** 2
        cost = 0.5 * problem.n * squares.reshape(len(at.m), x_0.shape[1], -1).sum(axis=(0, 2))
        condensed = condense(problem, at, sigma)
    H, g = (np.stack([getattr(each, name) for each in condensed]) for name in ("H", "g"))
    return np.where(np.isfinite(cost), cost, np.inf), H, g


def _damped_steps(H: FloatArray, g: FloatArray, damping: FloatArray) -> FloatArray:
    """Return the step of every window's scaled initial state, shape (nx, B)."""
    diagonal = np.einsum("bii->bi", H)
    ridge = damping[:, None] * diagonal + 1e-9 * diagonal.sum(axis=1, keepdims=True)
    damped = H + ridge[:, :, None] * np.eye(H.shape[1])
    return np.asarray(np.linalg.solve(damped, g[:, :, None])[:, :, 0].T)
