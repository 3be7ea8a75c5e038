"""The axis from one sample to the next: fed with recorded inputs, or within its control loop."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from pneumo_casadi.data import (
    Arrangement,
    Controller,
    InputHold,
    NestedController,
    Recording,
)
from pneumo_casadi.data.control.law import ControlLaw
from pneumo_casadi.data.control.memory import memory_at_start
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.integration import count_held, held_inputs, sample_lengths
from pneumo_casadi.model.stepping import Stepping
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
        _ = self.law  # refuses a loop without a law
        if self.controller is not None and self.stepping.hold is not InputHold.ZERO:
            raise ModelError("closed loop: a sampled controller holds its output (InputHold.ZERO)")

    @property
    def n_memory(self) -> int:
        """Number of values that the controller remembers."""
        return 0 if self.law is None else self.law.scales.size

    @property
    def n_initial(self) -> int:
        """Number of states, the first ones, whose initial values a fit estimates.

        Those of the axis, and the integrator of the controller. Filters forget; they begin as the
        measurements have them.
        """
        return len(self.axis.states) + (0 if self.law is None else self.law.n_integrators)

    @property
    def nx(self) -> int:
        """Number of states, the controller's memory last."""
        return len(self.axis.states) + self.n_memory

    @cached_property
    def state_scales(self) -> FloatArray:
        """Sizes by which an optimiser divides the states, shape (nx,)."""
        remembered = np.zeros(0) if self.law is None else self.law.scales
        scales: FloatArray = np.concatenate([self.axis.state_scales, remembered])
        scales.setflags(write=False)
        return scales

    @property
    def nw(self) -> int:
        """Number of values that one sample is given."""
        given = 2 * len(self.axis.inputs) - count_held(self.axis, self.stepping.hold)
        return (self.controller is not None) + given + self.stepping.timed

    @cached_property
    def law(self) -> ControlLaw | None:
        """The controller on the clock of the record, or None in open loop."""
        if self.controller is None:
            return None
        arrangement = getattr(self.axis.bench, "arrangement", Arrangement.TWO_3_2)
        return ControlLaw(self.controller, self.stepping.dt, arrangement)

    @cached_property
    def feedback(self) -> ca.Function:
        """The loop as ``(x, w, θ) -> [u; memory]`` with w = [x_ref; what is added to u; ...]."""
        axis, law = self.axis, self.law
        if law is None:
            raise ModelError("open loop: there is no feedback")
        sym, nxa = axis.symbol.sym, len(axis.states)
        x, w = sym("x", self.nx), sym("w", self.nw)
        theta = sym("theta", len(axis.parameters))
        # The sensor value does not depend on the input of the same instant.
        y = axis.output(x[:nxa], axis.symbol(ca.DM.zeros(len(axis.inputs))), theta)
        commands, kept = law.step(x[nxa:], w[0], y[axis.outputs.index("x")])
        further = ca.DM.zeros(len(axis.inputs) - len(axis.kind.commands))
        u = ca.vertcat(commands, further) + w[1 : 1 + len(axis.inputs)]
        return ca.Function("feedback", [x, w, theta], [ca.vertcat(u, kept)])

    def streams(self, record: Recording) -> FloatArray:
        """Return what every sample of a record is given, shape (nw, N - 1).

        Raises
        ------
        ModelError
            If the loop is closed and the record holds no reference.
        """
        if self.controller is None:
            return held_inputs(
                self.axis,
                record.stack(self.axis.inputs),
                record.hold,
                sample_lengths(record, self.stepping.dt),
            )
        if "x_ref" not in record:
            raise ModelError(
                f"record {record.name}: no reference x_ref; without it the loop cannot be "
                "simulated, fit in open loop"
            )
        added = added_inputs(self.axis, record)
        rows = np.vstack([record["x_ref"], added, next_further(self.axis, added)])[:, :-1]
        lengths = sample_lengths(record, self.stepping.dt)
        return rows if lengths is None else np.vstack([rows, lengths])

    def memory_at_start(self, state: FloatArray, record: Recording) -> FloatArray:
        """Return the controller's memory before the first row of a record, shape (n_memory,).

        It is the memory with which the law gives the recorded commands. A law that remembers
        positions alone takes the axis to have moved at its first velocity.
        """
        if self.law is None:
            return np.zeros(0)
        x, v = (state[self.axis.states.index(name)] for name in ("x", "v"))
        if isinstance(self.controller, NestedController):
            return self.law.rest(x, x, v)
        commands = self.axis.kind.commands
        u = record.stack(commands).T - added_inputs(self.axis, record)[: len(commands)]
        return memory_at_start(self.law, record["x_ref"], record["x"], u, v)

    def with_controller_memory(self, states: FloatArray, record: Recording) -> FloatArray:
        """Append the controller's memory to states of the samples of a record, shape (nx, N).

        A law that remembers positions alone follows those of the states.
        """
        if self.law is None or not self.n_memory:
            return states
        start = self.memory_at_start(states[:, 0], record)
        if isinstance(self.controller, NestedController):
            x_ref = x = states[self.axis.states.index("x")]
        else:
            x_ref, x = record["x_ref"], record["x"]
        _, memory = self.law.replay(x_ref, x, start)
        return np.vstack([states, memory])


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


def next_further(axis: Axis, added: FloatArray) -> FloatArray:
    """Return the further inputs, those behind the commands, one sample later; the last one stays.

    `added` (nu, N) is what `added_inputs` returns.
    """
    further = added[len(axis.kind.commands) :]
    return np.hstack([further[:, 1:], further[:, -1:]])
