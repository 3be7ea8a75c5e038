"""Sites: where an unknown term may act, and over which quantity.

A site is a balance (or both mass flows alike), a factor that multiplies the unknown function, and
its driver: ``force: sign(v) · f(x)`` is a friction level over position, ``mass flows: q_m · f(t)``
a valve gain that drifts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneumo_casadi.data import AxisKind
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.balances import chamber_capacities
from pneumo_casadi.model.compilation import call_with_arrays
from pneumo_casadi.parameters import FloatArray

#: A driver that varies by less than this share of its largest magnitude moves nothing.
LEAST_VARIATION = 1e-3
#: Drivers of a force and of a flow, as far as the axis has them. u is the command, F the force of
#: a force-driven axis.
DRIVERS = ("x", "v", "t", "p_P", "p_N", "u_P", "u_N", "F", "t_reversal", "s_reversal")


@dataclass(frozen=True, slots=True)
class Site:
    """Where a term may act.

    Parameters
    ----------
    balances : tuple of str
        ``("force",)``, ``("mass_flow_P",)``, ``("mass_flow_N",)`` or both mass flows.
    factor : str
        What multiplies the function of the driver; see `FACTORS`.
    driver : str
        See `DRIVERS`.
    """

    balances: tuple[str, ...]
    factor: str
    driver: str


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

    def driver(self, name: str) -> FloatArray | None:
        """Return a driver, (N,); None where the axis has no such signal."""
        if name == "t":
            return self.motion.t
        if name == "t_reversal":
            return np.asarray(self.motion.t - self.motion.t[self._reversals])
        if name == "s_reversal":
            x = self.measured["x"]
            return np.asarray(np.abs(x - x[self._reversals]))
        return self.measured.get(name)

    def factor(self, balance: str, name: str) -> FloatArray:
        """Return a factor of a balance in units of its residual per unit of the term, (N,)."""
        return self._gain(balance) * self._factors(balance)[name]

    def _gain(self, balance: str) -> FloatArray:
        """Return what a force [N] or a flow [kg/s] adds to a residual."""
        values = self.axis.parameters.as_dict()
        (written,) = (b for b in self.axis.kind.balances if str(b.name) == balance)
        if balance == "force":
            return np.full(self.motion.N, 1 / values["M"] if written.over_inertia else 1.0)
        capacity = chamber_capacities(self.measured["x"], values)
        return np.asarray(1 / (capacity.P if balance.endswith("P") else capacity.N))

    def _factors(self, balance: str) -> Mapping[str, FloatArray]:
        unity = np.ones(self.motion.N)
        if balance == "force":
            return {"1": unity, "sign(v)": self.sign, "v": self.measured["v"]}
        q = self._flows[0 if balance.endswith("P") else 1]
        return {"1": unity, "q_m": q, "inflow": np.maximum(q, 0), "outflow": np.minimum(q, 0)}

    @cached_property
    def _flows(self) -> FloatArray:
        """Flows through the valves as the model has them, (2, N)."""
        f = self.axis.valve_flow.map(self.motion.N)
        theta = np.tile(self.axis.parameters.values[:, None], self.motion.N)
        return call_with_arrays(f, self.motion.x, self.motion.u, theta)[0]


def all_sites(kind: AxisKind, drivers: Sequence[str]) -> tuple[Site, ...]:
    """Return the sites of an axis, given the drivers that it has."""
    return tuple(
        Site(balances, factor, driver)
        for balances, factors in _factors_by_balance(kind).items()
        for factor in factors
        for driver in drivers
    )


def _factors_by_balance(kind: AxisKind) -> dict[tuple[str, ...], tuple[str, ...]]:
    flows = tuple(balance.name for balance in kind.balances if balance.chamber)
    known: dict[tuple[str, ...], tuple[str, ...]] = {("force",): ("1", "sign(v)", "v")}
    known |= {(flow,): ("1", "q_m") for flow in flows}
    return known | ({flows: ("q_m", "inflow", "outflow")} if len(flows) > 1 else {})
