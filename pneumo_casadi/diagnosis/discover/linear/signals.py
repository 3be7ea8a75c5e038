"""Signals along a smoothed motion: drivers of a term, and what multiplies it in a balance."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.balances import chamber_capacities
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Pair, Supply
from pneumo_casadi.model.machine_code.calls import call_with_arrays
from pneumo_casadi.parameters import FloatArray, Parameter

#: Relative change of a pressure of which the derivative of the flows is taken.
SHARE = 1e-3


@dataclass(frozen=True, eq=False)
class Signals:
    """Drivers and factors along one smoothed motion, at its own sampling rate.

    Parameters
    ----------
    axis : Axis
        Nominal, with the estimated parameters.
    motion : SmoothedMotion
        The motion.
    """

    axis: Axis
    motion: SmoothedMotion

    @cached_property
    def measured(self) -> Mapping[str, FloatArray]:
        """States and inputs by name, (N,)."""
        states = dict(zip(self.axis.motion_states, self.motion.x, strict=True))
        return dict(zip(self.axis.inputs, self.motion.u, strict=True)) | states

    def sensor(self, name: str) -> FloatArray:
        """Return what the sensor of a site ``measurement_x``, ``_P`` or ``_N`` shows, (N,)."""
        return self.measured["x" if name.endswith("x") else f"p_{name[-1]}"]

    def rate(self, name: str) -> FloatArray:
        """Return the derivative of a state, (N,)."""
        return np.asarray(self.motion.dx[self.axis.motion_states.index(name)])

    @cached_property
    def sign(self) -> FloatArray:
        """Direction of the motion, as the model smooths it, (N,)."""
        return np.asarray(np.tanh(self.measured["v"] / self.axis.parameters["v_s"].value))

    @cached_property
    def _reversals(self) -> FloatArray:
        """Index of the last sample at which the velocity changed its sign, (N,)."""
        v = self.measured["v"]
        forward = np.zeros(v.size, dtype=bool)
        forward[0] = v[0] > 0
        moving = np.abs(v) > 4 * self.motion.velocity_noise
        last = np.maximum.accumulate(np.where(moving, np.arange(v.size), 0))
        forward = v[last] > 0
        changed = np.flatnonzero(np.diff(forward.astype(int)) != 0) + 1
        marks = np.zeros(v.size, dtype=int)
        marks[changed] = changed
        return np.maximum.accumulate(marks)

    def driver(self, name: str, balance: str) -> FloatArray | None:
        """Return a driver in a balance, (N,); None where the axis has no such signal.

        ``u`` and ``p`` are command and pressure of the chamber of the balance.
        """
        chamber, other = balance[-1], {"P": "N", "N": "P"}.get(balance[-1], "")
        own = {"u": f"u_{chamber}", "p": f"p_{chamber}", "p_other": f"p_{other}"}.get(name, name)
        if own == "t":
            return self.motion.t
        if own == "t_reversal":
            return np.asarray(self.motion.t - self.motion.t[self._reversals])
        if own == "s_reversal":
            x = self.measured["x"]
            return np.asarray(np.abs(x - x[self._reversals]))
        if own in ("p_mean", "p_difference") and {"p_P", "p_N"} <= self.measured.keys():
            p_P, p_N = self.measured["p_P"], self.measured["p_N"]
            return (p_P + p_N) / 2 if own == "p_mean" else p_P - p_N
        return self.measured.get(own)

    def factor(self, balance: str, name: str) -> FloatArray:
        """Return a factor of a balance in units of its residual per unit of the term, (N,)."""
        return self.gain(balance) * self._factors(balance)[name]()

    def gain(self, balance: str) -> FloatArray:
        """Return what a force [N] or a flow [kg/s] adds to a residual."""
        values = self.axis.parameters.as_dict()
        (written,) = (b for b in self.axis.kind.balances if str(b.name) == balance)
        if balance == "force":
            return np.full(self.motion.N, 1 / values["M"] if written.over_inertia else 1.0)
        capacity = chamber_capacities(self.measured["x"], values)
        return np.asarray(1 / (capacity.P if balance.endswith("P") else capacity.N))

    def _factors(self, balance: str) -> Mapping[str, Callable[[], FloatArray]]:
        def unity() -> FloatArray:
            return np.ones(self.motion.N)

        if balance == "force":
            return {"1": unity, "sign(v)": lambda: self.sign, "v": lambda: self.measured["v"]}
        row = 0 if balance.endswith("P") else 1
        return {
            "1": unity,
            "p": lambda: self.measured[f"p_{balance[-1]}"],
            "q_m": lambda: self._flows[row],
            "p_supply": lambda: self._supply_flows[row],
            "dq_m/du": lambda: self._command_flows[row],
            "±dq_m/du": lambda: self._command_flows[row] * (1.0 if row == 0 else -1.0),
        }

    @cached_property
    def _flows(self) -> FloatArray:
        """Flows through the valves as the model has them, (2, N)."""
        return _flows_of(self.axis, self.motion, self.motion.x)

    def flow_slope(self, chamber: str) -> FloatArray:
        """Return the derivative of a valve's flow to the pressure of its chamber, (N,)."""
        row, i = 0 if chamber == "P" else 1, self.axis.motion_states.index(f"p_{chamber}")
        x = self.motion.x.copy()
        x[i] *= 1 + SHARE
        change = _flows_of(self.axis, self.motion, x)[row] - self._flows[row]
        return np.asarray(change / (SHARE * self.motion.x[i]))

    @cached_property
    def _supply_flows(self) -> FloatArray:
        """Derivatives of these flows to the relative change of the supply pressure, (2, N)."""
        raised = self.axis.with_effects(_Supply()).with_parameters({"supply.share": SHARE})
        return np.asarray((_flows_of(raised, self.motion, self.motion.x) - self._flows) / SHARE)

    @cached_property
    def _command_flows(self) -> FloatArray:
        """Derivatives of these flows to a shift of their commands, (2, N) [kg/(s V)]."""
        commands = [np.abs(u).max() for n, u in self.measured.items() if n.startswith("u")]
        step = SHARE * float(max(commands) or 1.0)
        above, below = (
            self.axis.with_effects(_Shift()).with_parameters({"shift.u": size})
            for size in (step, -step)
        )
        change = _flows_of(above, self.motion, self.motion.x)
        return np.asarray((change - _flows_of(below, self.motion, self.motion.x)) / (2 * step))


class _Shift(Effect):
    """Both spools off by u [V]."""

    name = "shift"
    parameters = (Parameter("u", 0.0, "V", null=0.0),)

    def spool(self, u: Pair, at: Scope) -> Pair:
        return Pair(u.P + at["u"], u.N + at["u"])


class _Supply(Effect):
    """Supply pressure (1 + share) times as high."""

    name = "supply"
    parameters = (Parameter("share", 0.0, "1", null=0.0),)

    def supply(self, ports: Supply, at: Scope) -> Supply:
        return Supply(ports.p_supply * (1 + at["share"]), ports.p_ext)


def _flows_of(axis: Axis, motion: SmoothedMotion, x: FloatArray) -> FloatArray:
    f = axis.valve_flow.map(motion.N)
    theta = np.tile(axis.parameters.values[:, None], motion.N)
    return call_with_arrays(f, x, motion.u, theta)[0]
