"""The balances of one structure of an axis, written symbolically and made into functions.

Values and bounds of parameters, geometry, pressures and gas enter as numbers at run time. One set
of functions therefore serves all fits of a model, and one machine code of its states every case.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca

from pneumo_casadi.model.along_record import (
    ArrayFunction,
    RecordFunction,
    Recursion,
    compile_recursion,
    compile_sample_functions,
)
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.balances import Balances, write_balances
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.valve import FlowISO6358, FlowPair
from pneumo_casadi.valve.flow_pair import valve_of

#: Coefficient of the Rosenbrock method ROS2, L-stable (Verwer et al. 1999, SIAM J. Sci. Comput.).
GAMMA = 1 - 0.5**0.5
#: Steps of ROS2 in a sample: with one, a sensor's lag of 4 ms at 1 kHz came out 0.25 % too long.
#: Along the motion that a sensor shows, its states alone are simulated, which costs little.
STEPS_OF_SENSORS, STEPS_OF_AXES = 2, 1
#: Structures that a process keeps. A diagnosis fits some fifty models, each from several starts.
MAX_KEPT = 128


class _FlowAt:
    """A flow model that takes its port pressures from symbols where it can."""

    def __init__(self, flow: Any, constants: Mapping[str, Expression]) -> None:
        self.parameters = flow.parameters
        self._flow, self._constants = flow, constants

    def expression(self, u: Any, p: Any, theta: Any) -> Any:
        return self.expression_at(u, p, theta, 1.0, 1.0)

    def expression_at(self, u: Any, p: Any, theta: Any, filling: Any, emptying: Any) -> Any:
        if not isinstance(self._flow, FlowISO6358):
            return self._flow.expression_at(u, p, theta, filling, emptying)
        c = self._constants
        ports = (c["flow_p_supply"] * filling, c["flow_p_ext"] * emptying)
        return self._flow.expression(u, p, theta, *ports)


def _flow_at(flow: Any, constants: Mapping[str, Expression]) -> Any:
    if isinstance(flow, FlowPair):
        return FlowPair(_FlowAt(flow.P, constants), _FlowAt(flow.N, constants))
    return _FlowAt(flow, constants)


@dataclass(frozen=True, eq=False)
class BalanceCode:
    """Functions of the balances; see `BalanceFunctions`.

    Parameters
    ----------
    axis : Axis
        An axis of this structure. Values and bounds of its parameters do not matter.
    """

    axis: Axis

    @property
    def n_z(self) -> int:
        """Number of states of the effects."""
        return len(self.axis.states) - len(self.axis.motion_states)

    @cached_property
    def _written(self) -> tuple[list[Any], Balances, Balances]:
        axis = self.axis
        sym: Any = axis.symbol.sym
        n = len(axis.motion_states)
        x, dx, u = sym("x", n), sym("dx", n), sym("u", len(axis.inputs))
        z, theta = sym("z", self.n_z), sym("theta", len(axis.parameters))
        names = list(constants_of(axis))
        c = sym("c", len(names))
        constants: dict[str, Any] = {name: c[i] for i, name in enumerate(names)}
        states = {name: x[i] for i, name in enumerate(axis.motion_states)}
        own = {name: z[i] for i, name in enumerate(axis.states[n:])}
        rates = {name: dx[i] for i, name in enumerate(axis.motion_states)}
        inputs = {name: u[i] for i, name in enumerate(axis.inputs)}
        named = {name: theta[i] for i, name in enumerate(axis.parameters.names)}
        flow = _flow_at(axis.flow, constants) if axis.kind.needs_flow_map else None

        def write(known: Mapping[str, Any]) -> Balances:
            return write_balances(
                axis.kind, known, rates, inputs, named, constants, axis.effects, flow
            )

        settled: dict[str, Any] = dict.fromkeys(own, 0.0)
        for _ in axis.effects:
            settled = dict(write(states | settled).rest) if own else {}
        return [x, dx, u, z, c, theta], write(states | own), write(states | settled)

    @cached_property
    def functions(self) -> dict[str, RecordFunction]:
        """Residuals, these with Jacobian; where effects need them, sensors and states at rest."""
        axis = self.axis
        symbols, written, at_rest = self._written
        theta = symbols[-1]
        r = ca.vertcat(*(written.residual[name] for name in axis.equations))
        # Mass flows over the capacity of the chamber, [Pa/s], and a force whose gain is free over
        # the mass, [m/s²]: a common scale of a balance must not make its residuals small. Nor must
        # the little air beside a sensor at the valve make the same error of a flow a large one.
        for i, balance in enumerate(axis.kind.balances):
            if balance.over_inertia:
                r[i] = r[i] / written.inertia[balance.name]
        y = ca.vertcat(*(written.output[name] for name in axis.outputs))
        exact = [axis.parameters.index(name) for name in self.analytic]
        J = ca.jacobian(r, theta)[:, exact]
        r, y = ca.densify(r), ca.densify(y)
        functions = [
            ca.Function("residual", symbols, [r]),
            ca.Function("residual_and_jacobian", symbols, [r, ca.densify(J)]),
        ]
        if any("output" in effect.junctions for effect in axis.effects):
            functions.append(ca.Function("shown", symbols, [y]))
        if self.n_z:
            rest = ca.vertcat(*(at_rest.rest[name] for name in axis.states[-self.n_z :]))
            functions.append(ca.Function("rest", symbols, [ca.densify(rest)]))
        return along_record(functions)

    @cached_property
    def step(self) -> Recursion:
        """One sample of the effects' states, compiled: every sample needs the one before."""
        moving = (True, True, True, True, True, True, False, False, False)  # h, c and θ do not
        return compile_recursion(self._step(), moving)

    def _step(self) -> ca.Function:
        """One sample of the effects' states: (z, x, x⁺, dx, dx⁺, u, u⁺, h, c, θ) → z⁺.

        Steps of ROS2, the motion linear between the samples. From the middle of one sample to that
        of the next an input that is held has both its values, half the time each.
        """
        (x, dx, u, z, c, theta), written, _ = self._written
        f = ca.vertcat(*(written.rates[name] for name in self.axis.states[-self.n_z :]))
        rate = ca.Function("rate", [x, dx, u, z, c, theta], [f, ca.densify(ca.jacobian(f, z))])
        sym: Any = self.axis.symbol.sym
        h, x_1, dx_1 = sym("h"), sym("x_1", x.shape[0]), sym("dx_1", x.shape[0])
        u_1 = sym("u_1", u.shape[0])
        between = (u + u_1) / 2
        of_sensors = all("output" in effect.junctions for effect in self.axis.effects)
        count = STEPS_OF_SENSORS if of_sensors else STEPS_OF_AXES
        identity, part, end = self.axis.symbol.eye(self.n_z), h / count, z
        for k in range(count):
            (x_k, dx_k), (x_next, dx_next) = (
                [first + share * (last - first) for first, last in ((x, x_1), (dx, dx_1))]
                for share in (k / count, (k + 1) / count)
            )
            f_0, J = rate(x_k, dx_k, between, end, c, theta)
            W = identity - GAMMA * part * J
            k_1 = ca.solve(W, f_0)
            f_1, _ = rate(x_next, dx_next, between, end + part * k_1, c, theta)
            k_2 = ca.solve(W, f_1 - 2 * k_1)
            end = end + part * (1.5 * k_1 + 0.5 * k_2)
        names = self.axis.states[-self.n_z :]
        after = [written.renewed.get(name, end[i]) for i, name in enumerate(names)]
        given = [z, x, x_1, dx, dx_1, u, u_1, h, c, theta]
        return ca.Function("step", given, [ca.densify(ca.vertcat(*after))])

    @cached_property
    def state_parameters(self) -> frozenset[str]:
        """Free parameters on which states of the effects or sensors depend."""
        (*_, theta), written, at_rest = self._written
        states = self.axis.states[len(self.axis.motion_states) :]
        known = [*(written.rates[name] for name in states), *(at_rest.rest[n] for n in states)]
        known += [written.output[name] for name in self.axis.outputs]
        felt = ca.which_depends(ca.vertcat(*known), theta)
        index = self.axis.parameters.index
        return frozenset(n for n in self.axis.parameters.free_names if felt[index(n)])

    @property
    def analytic(self) -> tuple[str, ...]:
        """Free parameters with analytic derivatives, see `BalanceFunctions.analytic`."""
        free = self.axis.parameters.free_names
        nominal = (name for name in free if "." not in name)
        own = (name for name in free if "." in name and name not in self.state_parameters)
        return (*nominal, *own)


def along_record(functions: Sequence[ca.Function]) -> dict[str, RecordFunction]:
    """Return functions by name, to be evaluated along records; compiled where NumPy cannot."""
    if all(ArrayFunction.suits(f) for f in functions):
        return {f.name(): ArrayFunction(f) for f in functions}
    return {f.function.name(): f for f in compile_sample_functions(functions)}


class _Structure:
    """An axis that equals another one where both have the same code.

    Effects without data of their own are equal if they are of one class; flow models if they are
    the same object, since they hold numbers that are part of the code.
    """

    def __init__(self, axis: Axis) -> None:
        self.axis = axis
        effects = tuple(type(e) if not vars(e) else id(e) for e in axis.effects)
        self._key = (
            type(axis),
            axis.kind,
            id(axis.flow),
            effects,
            axis.parameters.names,
            axis.parameters.free_names,
            tuple(constants_of(axis)),
        )

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Structure) and self._key == other._key


def balance_code(axis: Axis) -> BalanceCode:
    """Return the functions of the balances of an axis, made once for each structure."""
    return _kept_code(_Structure(axis))


@lru_cache(MAX_KEPT)
def _kept_code(structure: _Structure) -> BalanceCode:
    return BalanceCode(structure.axis)


def constants_of(axis: Axis) -> dict[str, float]:
    """Return the numbers that the functions take at run time, by name."""
    constants = dict(axis.constants)
    flow, _ = valve_of(axis.flow, "P")
    if isinstance(flow, FlowISO6358):
        constants["flow_p_supply"] = flow.p_supply
        constants["flow_p_ext"] = flow.p_ext
    return constants
