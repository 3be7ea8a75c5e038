"""The law of a controller, written once: for simulations, fits and checks of records."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pneumo_casadi.data.bench.bench_checks import rows_per_sample
from pneumo_casadi.data.bench.controllers import (
    Controller,
    CustomController,
    NestedController,
    NoController,
    ProportionalController,
)
from pneumo_casadi.data.bench.pid_controllers import AntiWindup, CascadeController, PidController
from pneumo_casadi.data.bench.valve_source import Arrangement
from pneumo_casadi.errors import ModelError
from pneumo_casadi.parameters import FloatArray

#: Rows that are computed in one call; a chain over a whole record takes longer to build than to
#: run.
CHUNK = 1000
#: Size of a remembered position [m].
POSITION = 0.1


@dataclass(frozen=True, eq=False)
class ControlLaw:
    """A controller on a clock: what it sets and remembers from one row of a record to the next.

    Parameters
    ----------
    controller : Controller
        The law.
    dt : float
        Step of the record [s].
    arrangement : Arrangement, optional
        Two three-way valves, or one five-way valve.

    Raises
    ------
    ModelError
        If no law is known.
    CaseError
        If the sampling period of the law is no whole multiple of `dt`.

    Examples
    --------
    >>> from pneumo_casadi.data.bench.pid_controllers import PidController
    >>> law = ControlLaw(PidController(k_p=10.0, u_max=5.0, k_i=100.0), 1e-3)
    >>> u, memory = law.replay([0.1, 0.1], [0.0, 0.0], law.rest(0.1, 0.0, 0.0))
    >>> u[0].round(4)
    array([1.01, 1.02])
    """

    controller: Controller
    dt: float
    arrangement: Arrangement = Arrangement.TWO_3_2

    def __post_init__(self) -> None:
        if isinstance(self.controller, NoController):
            raise ModelError(
                "closed loop: no controller is known; describe it in bench.json, or simulate in "
                "open loop"
            )

    @cached_property
    def rows(self) -> int:
        """Rows of the record for which the law holds its commands."""
        sample_time = self.controller.sample_time
        return 1 if sample_time is None else rows_per_sample(sample_time, self.dt)

    @property
    def period(self) -> float:
        """Sampling period of the law [s]."""
        return self.rows * self.dt

    @cached_property
    def step(self) -> ca.Function:
        """The law as ``(memory, x_ref, x) -> (u, memory)``, sampled at the rows of the record.

        Where it is sampled more slowly, the last values of the memory are the commands that are
        held and the rows since they were computed.
        """
        memory = ca.SX.sym("memory", self.scales.size)
        x_ref, x = ca.SX.sym("x_ref"), ca.SX.sym("x")
        own = memory[: self.n_own]
        u, kept = self._sampled(own, x_ref, x)
        if self.rows > 1:
            held, since = memory[self.n_own : -1], memory[-1]
            due = since < 0.5
            u = ca.if_else(due, u, held)
            counted = ca.if_else(since > self.rows - 1.5, 0, since + 1)
            kept = ca.vertcat(ca.if_else(due, kept, own), u, counted)
        return ca.Function("law", [memory, x_ref, x], [ca.densify(u), ca.densify(kept)])

    @property
    def n_own(self) -> int:
        """Number of values that the law itself remembers."""
        return self._own_scales.size

    @property
    def n_integrators(self) -> int:
        """Number of values of the memory, the first ones, that are never forgotten."""
        return 1 if getattr(self.controller, "k_i", 0.0) else 0

    @cached_property
    def scales(self) -> FloatArray:
        """Sizes of the values of the memory, shape (n_memory,)."""
        if self.rows == 1:
            return self._own_scales
        held = np.full(len(self.controller.inputs), getattr(self.controller, "u_max", 1.0))
        return np.concatenate([self._own_scales, held, [1.0]])

    @property
    def _own_scales(self) -> FloatArray:
        controller = self.controller
        if isinstance(controller, NestedController):
            return np.full(2, POSITION)
        if isinstance(controller, PidController | CascadeController):
            return np.array([controller.u_max, POSITION])
        if isinstance(controller, CustomController):
            return np.ones(len(controller.memory))
        return np.zeros(0)

    def rest(self, x_ref: float, x: float, v: float) -> FloatArray:
        """Return the memory before a sample at `x` [m], reached at the velocity `v` [m/s].

        Integrators are empty. Shape (n_memory,).
        """
        controller, T = self.controller, self.period
        own: ArrayLike
        if isinstance(controller, NestedController):
            own = [x - v * T, x - 2 * v * T]
        elif isinstance(controller, PidController):
            own = [0.0, -controller.derivative_filter * v - (x_ref - x + v * T)]
        elif isinstance(controller, CascadeController):
            own = [0.0, controller.velocity_filter * v - (x - v * T)]
        else:
            own = getattr(controller, "memory", ())
        return np.concatenate(
            [np.asarray(own, dtype=float), np.zeros(self.scales.size - self.n_own)]
        )

    def replay(
        self, x_ref: ArrayLike, x: ArrayLike, memory: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return what the law sets on recorded positions, and its memory before every row.

        Parameters
        ----------
        x_ref, x : (N,) array
            Reference and position [m].
        memory : (n_memory,) array
            Before the first row.

        Returns
        -------
        (nu, N) array, (n_memory, N) array
        """
        given = np.vstack([np.asarray(x_ref, dtype=float), np.asarray(x, dtype=float)])
        N, commands, memories = given.shape[1], [], []
        for first in range(0, N, CHUNK):
            part = given[:, first : first + CHUNK]
            u, kept = self._chain(part.shape[1])(memory, part[:1], part[1:])
            before = np.column_stack([memory, np.asarray(kept)])
            commands.append(np.asarray(u, dtype=float))
            memories.append(before[:, :-1])
            memory = before[:, -1]
        return np.hstack(commands), np.hstack(memories)

    def after(self, memory: FloatArray, x_ref: float, x: float) -> FloatArray:
        """Return the memory after a row, shape (n_memory,)."""
        return np.asarray(self.step(memory, x_ref, x)[1], dtype=float).ravel()

    def _chain(self, n: int) -> ca.Function:
        chains: dict[int, ca.Function] = self.__dict__.setdefault("_chains", {})
        if n not in chains:
            memory = ca.MX.sym("memory", self.scales.size)
            x_ref, x = ca.MX.sym("x_ref", 1, n), ca.MX.sym("x", 1, n)
            kept, u = self._swapped.mapaccum("chain", n)(memory, x_ref, x)
            chains[n] = ca.Function("replay", [memory, x_ref, x], [u, kept])
        return chains[n]

    @cached_property
    def _swapped(self) -> ca.Function:
        """The step with the memory as its first result, as a chain needs it."""
        memory, x_ref, x = (ca.SX.sym(n, self.step.size1_in(i)) for i, n in enumerate("mrx"))
        u, kept = self.step(memory, x_ref, x)
        return ca.Function("step", [memory, x_ref, x], [kept, u])

    def _sampled(self, memory: ca.SX, x_ref: ca.SX, x: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return the commands and the memory of one sample of the law."""
        controller, T = self.controller, self.period
        if isinstance(controller, CustomController):
            u, kept = controller.law(memory, x_ref, x)
            return u, kept
        if isinstance(controller, NestedController):
            # The velocity is the difference of means of two positions (Janot et al. 2019).
            v = (x - memory[1]) / (2 * T)
            demand = controller.k_v * (controller.k_p * (x_ref - x) - v)
            clipped = _clip(demand, -controller.u_max, controller.u_max)
            return controller.gain * clipped, ca.vertcat(x, memory[0])
        if isinstance(controller, ProportionalController):
            clipped = _clip(controller.gain * (x_ref - x), -controller.u_max, controller.u_max)
            return self._opposed(clipped), memory
        assert isinstance(controller, PidController | CascadeController)
        if isinstance(controller, PidController):
            tau, e = controller.derivative_filter, x_ref - x
            d = (memory[1] + e) / (tau + T)
            kept, direct = tau * d - e, controller.k_p * e + controller.k_d * d
        else:
            tau = controller.velocity_filter
            v = (memory[1] + x) / (tau + T)
            demand = controller.k_p * (x_ref - x)
            if controller.v_max is not None:
                demand = _clip(demand, -controller.v_max, controller.v_max)
            e = demand - v
            kept, direct = tau * v - x, controller.k_v * e
        u, integral = _limited(controller, direct, memory[0], controller.k_i * T * e, T)
        return self._opposed(u), ca.vertcat(integral, kept)

    def _opposed(self, u: ca.SX) -> ca.SX:
        u_0 = getattr(self.controller, "u_0", 0.0)
        if self.arrangement is Arrangement.ONE_5_3:
            return ca.vertcat(u_0 + u, -(u_0 + u))
        return ca.vertcat(u_0 + u, u_0 - u)


def _limited(
    controller: PidController | CascadeController,
    direct: ca.SX,
    integral: ca.SX,
    increment: ca.SX,
    T: float,
) -> tuple[ca.SX, ca.SX]:
    """Return the command within its limits, and the integral after this sample."""
    lower, upper = controller.limits
    demand = direct + integral + increment
    u = _clip(demand, lower, upper)
    if controller.anti_windup is AntiWindup.CLAMPING:
        above = ca.logic_and(demand > upper, increment > 0)
        below = ca.logic_and(demand < lower, increment < 0)
        return u, integral + ca.if_else(ca.logic_or(above, below), 0, increment)
    if controller.anti_windup is AntiWindup.BACK_CALCULATION:
        assert controller.tracking_time is not None
        return u, integral + increment + T / controller.tracking_time * (u - demand)
    return u, integral + increment


def _clip(value: ca.SX, lower: float, upper: float) -> ca.SX:
    return ca.fmin(ca.fmax(value, lower), upper)
