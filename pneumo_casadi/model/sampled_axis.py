"""The axis from one sample to the next: fed with recorded inputs, or within its control loop."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from pneumo_casadi.data import (
    Controller,
    InputHold,
    NoController,
    ProportionalController,
    Recording,
)
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.integration import Stepping, held_inputs
from pneumo_casadi.parameters import FloatArray


@dataclass(frozen=True, eq=False)
class SampledAxis:
    """What one sample does to an axis.

    Parameters
    ----------
    axis : Axis
        The model.
    stepping : Stepping
        Sampling period, input hold and Runge-Kutta steps.
    controller : Controller, optional
        Closes the loop: at every sample it reads the simulated position and sets the inputs.
        None feeds the axis with the inputs as recorded.

    Raises
    ------
    ModelError
        If the loop is closed and inputs are said to change between samples.
    """

    axis: Axis
    stepping: Stepping
    controller: Controller | None = None

    def __post_init__(self) -> None:
        if isinstance(self.controller, NoController):
            raise ModelError(
                "closed loop: no controller is known; describe it in bench.json, or simulate in "
                "open loop"
            )
        if self.controller is not None and self.stepping.hold is not InputHold.ZERO:
            raise ModelError("closed loop: a sampled controller holds its output (InputHold.ZERO)")

    @property
    def n_memory(self) -> int:
        """Number of values that the controller remembers."""
        return 0 if self.law is None else int(self.law.size1_in(0))

    @property
    def nx(self) -> int:
        """Number of states, the controller's memory last."""
        return len(self.axis.states) + self.n_memory

    @property
    def state_scales(self) -> FloatArray:
        """Sizes by which an optimiser divides the states, shape (nx,)."""
        scales = self.axis.state_scales
        # All that a controller remembers are positions.
        remembered = np.full(self.n_memory, scales[self.axis.states.index("x")])
        return np.concatenate([scales, remembered])

    @property
    def nw(self) -> int:
        """Number of values that one sample is given."""
        nu = len(self.axis.inputs)
        if self.controller is not None:
            return 1 + nu
        return 2 * nu if self.stepping.hold is InputHold.LINEAR else nu

    @cached_property
    def law(self) -> ca.Function | None:
        """The controller as ``(memory, x_ref, x) -> (u, memory)``, or None in open loop."""
        return None if self.controller is None else control_law(self.controller, self.stepping.dt)

    @cached_property
    def feedback(self) -> ca.Function:
        """The loop as ``(x, w, θ) -> [u; memory]`` with w = [x_ref; what is added to u]."""
        axis, law = self.axis, self.law
        if law is None:
            raise ModelError("open loop: there is no feedback")
        sym, nxa = axis.symbol.sym, len(axis.states)
        x, w = sym("x", self.nx), sym("w", self.nw)
        theta = sym("theta", len(axis.parameters))
        # The sensor value does not depend on the input of the same instant.
        y = axis.output(x[:nxa], axis.symbol(ca.DM.zeros(len(axis.inputs))), theta)
        commands, kept = law(x[nxa:], w[0], y[axis.outputs.index("x")])
        further = ca.DM.zeros(len(axis.inputs) - len(axis.kind.commands))
        u = ca.vertcat(commands, further) + w[1:]
        return ca.Function("feedback", [x, w, theta], [ca.vertcat(u, kept)])

    def streams(self, record: Recording) -> FloatArray:
        """Return what every sample of a record is given, shape (nw, N - 1).

        Raises
        ------
        ModelError
            If the loop is closed and the record holds no reference.
        """
        if self.controller is None:
            return held_inputs(record.stack(self.axis.inputs), record.hold)
        if "x_ref" not in record:
            raise ModelError(
                f"record {record.name}: no reference x_ref; without it the loop cannot be "
                "simulated, fit in open loop"
            )
        return np.vstack([record["x_ref"], added_inputs(self.axis, record)])[:, :-1]

    def with_controller_memory(self, states: FloatArray) -> FloatArray:
        """Append the controller's memory to states of successive samples, shape (nx, N).

        It holds the positions of the last samples; before the first one the axis is taken to
        have moved at its first velocity.
        """
        if not self.n_memory:
            return states
        x, v = (states[self.axis.states.index(name)] for name in ("x", "v"))
        before = x[0] - v[0] * self.stepping.dt * np.arange(self.n_memory, 0, -1)
        path = np.concatenate([before, x])
        last = [path[self.n_memory - 1 - i : len(path) - 1 - i] for i in range(self.n_memory)]
        return np.vstack([states, *last])


def added_inputs(axis: Axis, record: Recording) -> FloatArray:
    """Return what a record adds to the controller's commands, shape (nu, N).

    For commands that is a recorded disturbance ``F_pulse`` or zero; further inputs, such as the
    supply pressure, are as they were recorded.
    """
    rows = np.zeros((len(axis.inputs), record.N))
    if "F_pulse" in record:
        rows[: len(axis.kind.commands)] += record["F_pulse"]
    for row, name in enumerate(axis.inputs):
        if name not in axis.kind.commands:
            rows[row] = record[name]
    return rows


def control_law(controller: Controller, dt: float) -> ca.Function:
    """Return a controller as ``(memory, x_ref, x) -> (u, memory)``.

    The nested controller takes its velocity from the positions of this and the last two
    instants: the difference of means of two, (x_k - x_{k-2}) / (2 dt) (Janot et al. 2019).
    """
    if isinstance(controller, NoController):
        raise ModelError("closed loop: no controller is known; simulate in open loop")
    x_ref, x, u_max = ca.SX.sym("x_ref"), ca.SX.sym("x"), controller.u_max

    def clip(value: ca.SX) -> ca.SX:
        return ca.fmin(ca.fmax(value, -u_max), u_max)

    if isinstance(controller, ProportionalController):
        memory = ca.SX.sym("memory", 0)
        voltage = clip(controller.gain * (x_ref - x))
        u, kept = ca.vertcat(voltage, -voltage), memory
    else:
        memory = ca.SX.sym("memory", 2)
        v = (x - memory[1]) / (2 * dt)
        u = controller.gain * clip(controller.k_v * (controller.k_p * (x_ref - x) - v))
        kept = ca.vertcat(x, memory[0])
    return ca.Function("law", [memory, x_ref, x], [u, kept])
