"""Initial states of a record or of its windows, all parameters known."""

import casadi as ca
import numpy as np

from pneumo_casadi.axis import Axis
from pneumo_casadi.errors import FitError
from pneumo_casadi.integration import Stepping, accumulate, block_functions, substeps_for
from pneumo_casadi.output_error.condensing import linearise, scaled_normal_equations
from pneumo_casadi.output_error.problem import Problem, Unknowns
from pneumo_casadi.output_error.segments import cut
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.recording import Recording
from pneumo_casadi.statistics import stated_or_estimated_noise

#: Length of the blocks whose mean outputs are compared [s].
BLOCK = 2e-3
#: Damped Gauss-Newton iterations; a window that sticks needs a dozen.
ITERATIONS = 15
#: Relative decrease of a window's cost below which it has settled.
SETTLED = 1e-4
#: Damping to begin with, and the factors by which it falls and grows.
DAMPING, FALL, GROW = 1e-3, 0.2, 10.0


def estimate_initial_states(
    axis: Axis, record: Recording, window: float | None = None
) -> tuple[tuple[int, FloatArray], ...]:
    """Estimate the state at the start of a record, or of each whole window, by output error.

    Every window is a least-squares problem of its own in its initial state, solved by damped
    steps that only ever lower its cost, all windows side by side.

    Parameters
    ----------
    axis : Axis
        With known parameters.
    record : Recording
        Measured inputs and outputs.
    window : float, optional
        Length of the windows [s]; None for the whole record.

    Returns
    -------
    tuple of (int, (nx,) array)
        First sample and state of each window.

    Raises
    ------
    FitError
        If a window's simulation leaves the finite numbers already at the measured state.
    """
    problem = _problem(axis, record, window)
    sigma = np.array([stated_or_estimated_noise(axis.bench, [record], c) for c in axis.outputs])
    x_0 = np.stack([segment.x[:, 0] for segment in problem.segments], axis=1)
    nodes, cost = _costs(problem, x_0, sigma)
    if not np.isfinite(cost).all():
        start = problem.segments[int(np.argmin(np.isfinite(cost)))].first * record.dt
        raise FitError(f"{record.name}: no simulation from the measured state at t = {start:g} s")
    damping = np.full(cost.size, DAMPING)
    active = np.ones(cost.size, dtype=bool)
    for _ in range(ITERATIONS):
        step = _damped_steps(problem, nodes, sigma, damping)
        trial, new = _costs(problem, x_0 + np.where(active, step, 0.0), sigma)
        better = new < cost
        small = better & (cost - new < SETTLED * cost)
        x_0 = np.where(better, x_0 + step, x_0)
        nodes = np.where(better[:, None, None], trial, nodes)
        cost = np.where(better, new, cost)
        damping = np.where(better, damping * FALL, damping * GROW)
        active &= ~small & (damping < 1e8)
        if not active.any():
            break
    return tuple((segment.first, x_0[:, i]) for i, segment in enumerate(problem.segments))


def _problem(axis: Axis, record: Recording, window: float | None) -> Problem:
    stepping = Stepping(record.dt, record.hold, substeps_for(axis, record.dt))
    n = max(1, round(BLOCK / record.dt))
    segments = cut(axis, [record], axis.parameters, n, window)
    whole = tuple(segment for segment in segments if segment.K == segments[0].K)
    blocks = block_functions(axis, stepping, n, ())
    return Problem(axis, axis.parameters.fix(), whole, blocks, None)


def _costs(problem: Problem, x_0: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return nodes (B, nx, K + 1) and the cost of each window (B,); infinite where not finite."""
    B, n = x_0.shape[1], problem.blocks.n
    # One block's inputs are one step of the chain: (nw, n) flattened column by column.
    w = np.stack([s.w.T.reshape(s.K, -1).T for s in problem.segments])
    ends, m = accumulate(_flat(problem), x_0, [w], problem.parameters.values)
    y = np.stack([segment.y for segment in problem.segments])
    cost = 0.5 * n * np.sum(((y - m) / sigma[:, None]) ** 2, axis=(1, 2))
    nodes = np.concatenate([x_0.T[:, :, None], ends], axis=2).reshape(B, len(x_0), -1)
    return nodes, np.where(np.isfinite(cost), cost, np.inf)


def _flat(problem: Problem) -> ca.Function:
    """Return a block whose inputs are one column, as a chain of steps wants them."""
    value = problem.blocks.value
    nx, (nw, n) = value.size1_in(0), value.size_in(1)
    x, w = ca.MX.sym("x", nx), ca.MX.sym("w", nw * n)
    theta = ca.MX.sym("theta", value.size1_in(2))
    ends, m = value(x, ca.reshape(w, nw, n), theta)
    return ca.Function("flat", [x, w, theta], [ends, m])


def _damped_steps(
    problem: Problem, nodes: FloatArray, sigma: FloatArray, damping: FloatArray
) -> FloatArray:
    """Return the step of every window's initial state, shape (nx, B)."""
    point = Unknowns(problem.parameters.values, np.hstack(list(nodes)), problem.y)
    scale = problem.axis.state_scales
    steps = []
    for segment, weight in zip(linearise(problem, point).segments, damping, strict=True):
        H, g = scaled_normal_equations(problem, segment, sigma)
        ridge = weight * np.diag(H) + 1e-9 * np.trace(H)
        steps.append(np.linalg.solve(H + np.diag(ridge), g) * scale)
    return np.stack(steps, axis=1)
