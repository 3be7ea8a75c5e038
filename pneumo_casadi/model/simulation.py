"""Simulation of an axis: open loop, closed loop with the recorded controller, many windows."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pneumo_casadi.data import Controller, InputHold
from pneumo_casadi.data.control.law import ControlLaw
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.along_record import evaluated_without_compiling
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.integration import accumulate, held_inputs, step_function
from pneumo_casadi.model.machine_code.compilation import compile_functions
from pneumo_casadi.model.sampled_axis import SampledAxis, next_further
from pneumo_casadi.model.stepping import Stepping, stepping_for
from pneumo_casadi.model.validity.arguments import (
    check_clock,
    check_disturbance,
    check_inputs,
    check_memory,
    check_reference,
)
from pneumo_casadi.model.validity.physical_range import (
    require_physical,
    require_physical_start,
)
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.presentation import Brief


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Brief):
    """States, outputs and inputs at the sampling instants.

    Parameters
    ----------
    t : (N,) array
        Time [s].
    states, outputs, inputs : tuple of str
        Names of the rows below.
    x : (nx, N) array
        States.
    y : (ny, N) array
        Outputs, what sensors without noise would show.
    u : (nu, N) array
        Inputs; u[:, k] acts from t[k] on.
    """

    t: FloatArray
    states: tuple[str, ...]
    x: FloatArray
    outputs: tuple[str, ...]
    y: FloatArray
    inputs: tuple[str, ...]
    u: FloatArray

    def __getitem__(self, name: str) -> FloatArray:
        """Return an output, state or input by name; outputs first."""
        rows = ((self.outputs, self.y), (self.states, self.x), (self.inputs, self.u))
        for names, values in rows:
            if name in names:
                signal: FloatArray = values[names.index(name)]
                return signal
        raise KeyError(name)


def simulate_windows(axis: Axis, stepping: Stepping, w: FloatArray, x_0: FloatArray) -> FloatArray:
    """Simulate many stretches of equal length side by side.

    Parameters
    ----------
    w : (B, nw, L) array
        Inputs of every step of each stretch, see `held_inputs`.
    x_0 : (nx, B) array
        Initial states.

    Returns
    -------
    (B, nx, L + 1) array
        States at all sampling instants, the initial ones included.
    """
    (step,) = compile_functions([step_function(axis, stepping)])
    (after,) = accumulate(step, x_0, [w], axis.parameters.values)
    return np.concatenate([x_0.T[:, :, None], after], axis=2)


def simulate(
    axis: Axis,
    u: ArrayLike,
    dt: float,
    x_0: ArrayLike,
    hold: InputHold = InputHold.ZERO,
    lengths: FloatArray | None = None,
) -> Trajectory:
    """Simulate an axis in open loop.

    Parameters
    ----------
    axis : Axis
        The axis, with the values of its parameters.
    u : (N, nu) array
        Inputs at the sampling instants [V; N for a force-driven, Pa for a pressure-driven axis].
    dt : float
        Sampling period [s].
    x_0 : (nx,) array
        Initial state in the order of ``axis.states``: p_P, p_N [Pa], x [m], v [m/s] for a servo
        axis, x, v for a force-driven axis, then the states of the effects. If those are left out,
        effects start at rest.
    hold : InputHold
        Course of the commands between the sampling instants: constant, or linear. Measured
        inputs run linearly in any case.
    lengths : (N - 1,) array, optional
        Length of each sampling interval divided by `dt`, where the clock is not uniform.

    Returns
    -------
    Trajectory
        Time, states, outputs without noise, and inputs at the N sampling instants; index it by
        name, as in ``trajectory["x"]``.

    Raises
    ------
    ModelError
        If arguments do not fit together, or the axis leaves what it can be: a chamber without
        volume, a pressure that is not positive, numbers that are not finite.

    Examples
    --------
    >>> from pneumo_casadi.data import ForceBench, NestedController
    >>> from pneumo_casadi.model.servosystem import ForceAxis
    >>> bench = ForceBench(1e3, None, NestedController(160.0, 243.0, 35.0, 10.0))
    >>> free = {"M": 2.0, "f_v": 0.0, "F_c_plus": 0.0, "F_c_minus": 0.0}
    >>> axis = ForceAxis(bench).with_parameters(free)
    >>> run = simulate(axis, np.full((1001, 1), 4.0), 1e-3, [0.0, 0.0])
    >>> round(float(run["x"][-1]), 6)
    1.0
    """
    inputs = check_inputs(axis.kind, u)
    check_clock(dt, lengths, len(inputs))
    start = full_state(axis, x_0, inputs[0])
    require_physical_start(axis.kind, axis.parameters, axis.constants, start)
    t, x, u = _open_loop(axis, inputs, dt, start, hold, lengths)
    require_physical(axis.kind, axis.parameters, t, x, u)
    return _trajectory(axis, t, x, u)


def run_open_loop(
    axis: Axis,
    u: FloatArray,
    dt: float,
    x_0: FloatArray,
    hold: InputHold = InputHold.ZERO,
    lengths: FloatArray | None = None,
) -> Trajectory:
    """Simulate as `simulate` does, wherever the axis goes as long as all numbers are finite.

    A model that is compared with a record may drift beyond the end of the stroke: that is an error
    of the model, not of the call.
    """
    return _trajectory(axis, *_open_loop(axis, u, dt, full_state(axis, x_0, u[0]), hold, lengths))


def _open_loop(
    axis: Axis,
    u: FloatArray,
    dt: float,
    start: FloatArray,
    hold: InputHold,
    lengths: FloatArray | None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return time, states and inputs."""
    stepping = stepping_for(axis, dt, hold, lengths)
    w = held_inputs(axis, u, hold, lengths)
    x = simulate_windows(axis, stepping, w[None], start[:, None])[0]
    return _instants(dt, len(u), lengths), x, u.T


def _instants(dt: float, N: int, lengths: FloatArray | None) -> FloatArray:
    """Return the instants of N samples, the first one at 0 [s]."""
    if lengths is None:
        return dt * np.arange(N, dtype=float)
    return dt * np.concatenate([[0.0], np.cumsum(lengths)])


def simulate_closed_loop(
    axis: Axis,
    x_ref: ArrayLike,
    dt: float,
    x_0: ArrayLike,
    controller: Controller | None = None,
    disturbance: ArrayLike | None = None,
    memory: ArrayLike | None = None,
    lengths: FloatArray | None = None,
) -> Trajectory:
    """Simulate an axis under its sampled controller.

    At every instant the controller reads the position and sets the inputs, which hold until
    the next instant.

    Parameters
    ----------
    x_ref : (N,) array
        Reference of the position [m].
    dt : float
        Sampling period [s].
    x_0 : (nx,) array
        Initial state, see `simulate`.
    controller : controller, optional
        By default the bench's.
    disturbance : (N,) or (N, nu) array, optional
        Added to what the controller sets [V or N]: one value to all commands, or one to each input,
        further inputs such as a supply pressure whole, which run linearly between the instants.
        By default these are as at rest.
    memory : (n_memory,) array, optional
        What the controller remembers before the first sample. By default integrators are empty
        and the axis has moved at its first velocity.
    lengths : (N - 1,) array, optional
        Lengths of the samples over dt, where the clock is not uniform.

    Returns
    -------
    Trajectory

    Raises
    ------
    ModelError
        If there is no controller, arguments do not fit together, or the axis leaves what it can be,
        see `simulate`.

    Examples
    --------
    >>> import numpy as np
    >>> from pneumo_casadi.data import ForceBench, NestedController
    >>> from pneumo_casadi.model.servosystem import ForceAxis
    >>> bench = ForceBench(1e3, None, NestedController(30.0, 60.0, 1.0, 60.0))
    >>> axis = ForceAxis(bench).with_parameters({"M": 1.0, "f_v": 1.0})
    >>> run = simulate_closed_loop(axis, np.full(2001, 0.1), 1e-3, [0.0, 0.0])
    >>> bool(abs(run["x"][-1] - 0.1) < 0.03)
    True
    """
    start = full_state(axis, x_0, axis.inputs_at_rest)
    require_physical_start(axis.kind, axis.parameters, axis.constants, start)
    given = controller, disturbance, memory, lengths
    t, x, u = _closed_loop(axis, check_reference(x_ref), dt, start, *given)
    require_physical(axis.kind, axis.parameters, t, x, u)
    return _trajectory(axis, t, x, u)


def run_closed_loop(
    axis: Axis,
    x_ref: FloatArray,
    dt: float,
    x_0: FloatArray,
    controller: Controller | None = None,
    disturbance: ArrayLike | None = None,
    memory: ArrayLike | None = None,
    lengths: FloatArray | None = None,
) -> Trajectory:
    """Simulate as `simulate_closed_loop` does, wherever the axis goes; see `run_open_loop`."""
    start = full_state(axis, x_0, axis.inputs_at_rest)
    given = controller, disturbance, memory, lengths
    return _trajectory(axis, *_closed_loop(axis, x_ref, dt, start, *given))


def _closed_loop(
    axis: Axis,
    reference: FloatArray,
    dt: float,
    start: FloatArray,
    controller: Controller | None,
    disturbance: ArrayLike | None,
    memory: ArrayLike | None,
    lengths: FloatArray | None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return time, states and inputs of the loop."""
    N, commands = reference.size, len(axis.kind.commands)
    check_clock(dt, lengths, N)
    added = np.tile(axis.inputs_at_rest, (N, 1))
    if disturbance is not None:
        given = check_disturbance(axis.kind, disturbance, N)
        added[:, : commands if given.shape[1] == 1 else None] = given
    law = controller or axis.bench.controller
    model = SampledAxis(axis, stepping_for(axis, dt, lengths=lengths), law)
    step = _closed_step(model)
    if memory is None:
        x, v = (start[axis.states.index(name)] for name in ("x", "v"))
        memory = ControlLaw(law, dt).rest(reference[0], x, v)
    state = np.concatenate([start, check_memory(memory, model.n_memory)])
    rows = [reference[None], added.T, next_further(axis, added.T)]
    if lengths is not None:
        rows.append(np.append(lengths, 1.0)[None])
    streams = [np.vstack(rows)[None]]
    _, x, u = accumulate(step, state[:, None], streams, axis.parameters.values)
    return _instants(dt, N, lengths), x[0], u[0]


def _closed_step(model: SampledAxis) -> ca.Function:
    """Return one sample of the loop, ([x; memory], w, θ) → (next, x, u), w as in its streams."""
    axis, sym = model.axis, ca.MX.sym
    nx, nu = len(axis.states), len(axis.inputs)
    state, w, theta = sym("state", model.nx), sym("w", model.nw), sym("theta", len(axis.parameters))
    output = model.feedback(state, w, theta)
    x, u = state[:nx], output[:nu]
    ahead = step_function(axis, model.stepping)(x, ca.vertcat(u, w[1 + nu :]), theta)
    following = ca.vertcat(ahead, output[nu:])
    step = ca.Function("closed_step", [state, w, theta], [following, x, u])
    return compile_functions([step])[0]


def full_state(axis: Axis, x_0: ArrayLike, u_0: FloatArray) -> FloatArray:
    """Return an initial state of all states; effects at rest where only nominal ones are given."""
    start = np.asarray(x_0, dtype=float)
    if start.shape == (len(axis.states),):
        return start
    if start.shape != (len(axis.motion_states),):
        raise ModelError(
            f"x_0: shape {start.shape}, expected one value each of {', '.join(axis.states)}"
        )
    full = axis.rest(start, u_0, axis.parameters.values)
    return np.asarray(full, dtype=float).ravel()


def compute_outputs(axis: Axis, x: FloatArray, u: FloatArray) -> FloatArray:
    """Return the outputs, shape (ny, N), of states (nx, N) and inputs (nu, N)."""
    output = evaluated_without_compiling(axis.output)
    return output.evaluate(x.shape[1], x, u, axis.parameters.values)[0]


def _trajectory(axis: Axis, t: FloatArray, x: FloatArray, u: FloatArray) -> Trajectory:
    bad = ~np.isfinite(x).all(axis=0)
    if bad.any():
        raise ModelError(
            f"the simulation leaves the finite numbers at t = {t[np.argmax(bad)]:g} s; "
            "look at the parameters (volumes that reach zero within the stroke?)"
        )
    names: Sequence[tuple[str, ...]] = (axis.states, axis.outputs, axis.inputs)
    return Trajectory(t, names[0], x, names[1], compute_outputs(axis, x, u), names[2], u)
