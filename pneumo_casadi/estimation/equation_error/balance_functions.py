"""The balances as functions along a given motion, compiled once for all axes of a kind.

Geometry, pressures and gas enter as numbers at run time, so that the machine code of an effect
serves every case.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca

from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.balances import Balances, write_balances
from pneumo_casadi.model.compilation import compile_functions
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.valve import FlowISO6358, FlowPair
from pneumo_casadi.valve.flow_pair import valve_of

#: Coefficient of the Rosenbrock method ROS2, L-stable (Verwer et al. 1999, SIAM J. Sci. Comput.).
GAMMA = 1 - 0.5**0.5
#: Samples that one call of the machine code takes; records are cut to a multiple of it.
STRETCH = 64


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
class BalanceFunctions:
    """Residuals of the balances of an axis along a given motion.

    All functions take columns ``x (n,), dx (n,), u (nu,), z (nz,), c (nc,), θ (nθ,)``: nominal
    states and derivatives, inputs, states of the effects, constants and parameters.

    Parameters
    ----------
    axis : Axis
        With its effects.
    """

    axis: Axis

    @property
    def constants(self) -> dict[str, float]:
        """Numbers that the functions take at run time, by name."""
        constants = dict(self.axis.constants)
        flow, _ = valve_of(self.axis.flow, "P")
        if isinstance(flow, FlowISO6358):
            constants["flow_p_supply"] = flow.p_supply
            constants["flow_p_ext"] = flow.p_ext
        return constants

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
        names = list(self.constants)
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
    def _functions(self) -> tuple[ca.Function, ...]:
        axis = self.axis
        symbols, written, at_rest = self._written
        theta = symbols[-1]
        r = ca.vertcat(*(written.residual[name] for name in axis.equations))
        # Mass flows over the capacity that takes them, [Pa/s], and a force whose gain is free over
        # the mass, [m/s²]: a common scale of a balance must not make its residuals small.
        for i, balance in enumerate(axis.kind.balances):
            if balance.over_inertia:
                r[i] = r[i] / -ca.jacobian(r[i], symbols[1])[axis.kind.states.index(balance.state)]
        y = ca.vertcat(*(written.output[name] for name in axis.outputs))
        exact = [axis.parameters.index(name) for name in self.analytic]
        J = ca.jacobian(r, theta)[:, exact]
        r, y = ca.densify(r), ca.densify(y)
        residual = ca.Function("one_residual", symbols, [r, y])
        with_jacobian = ca.Function("one_jacobian", symbols, [r, y, ca.densify(J)])
        functions = [
            _stretch("residual", residual, STRETCH, False),
            _stretch("residual_and_jacobian", with_jacobian, STRETCH, False),
        ]
        if self.n_z:
            rest = ca.vertcat(*(at_rest.rest[name] for name in axis.states[-self.n_z :]))
            functions += [
                ca.Function("rest", symbols, [ca.densify(rest)]),
                _stretch("steps", self._step(), STRETCH, True),
            ]
        return compile_functions(functions)

    def _step(self) -> ca.Function:
        """One sample of the effects' states by ROS2: (z, x, x⁺, dx, dx⁺, u, h, c, θ) → z⁺."""
        (x, dx, u, z, c, theta), written, _ = self._written
        f = ca.vertcat(*(written.rates[name] for name in self.axis.states[-self.n_z :]))
        rate = ca.Function("rate", [x, dx, u, z, c, theta], [f, ca.densify(ca.jacobian(f, z))])
        sym: Any = self.axis.symbol.sym
        h, x_1, dx_1 = sym("h"), sym("x_1", x.shape[0]), sym("dx_1", x.shape[0])
        f_0, J = rate(x, dx, u, z, c, theta)
        W = self.axis.symbol.eye(self.n_z) - GAMMA * h * J
        k_1 = ca.solve(W, f_0)
        f_1, _ = rate(x_1, dx_1, u, z + h * k_1, c, theta)
        k_2 = ca.solve(W, f_1 - 2 * k_1)
        end = z + h * (1.5 * k_1 + 0.5 * k_2)
        return ca.Function("step", [z, x, x_1, dx, dx_1, u, h, c, theta], [ca.densify(end)])

    @property
    def nominal_parameters(self) -> tuple[str, ...]:
        """Free parameters of the axis without its effects."""
        return tuple(name for name in self.axis.parameters.free_names if "." not in name)

    @property
    def effect_parameters(self) -> tuple[str, ...]:
        """Free parameters of the effects."""
        return tuple(name for name in self.axis.parameters.free_names if "." in name)

    @cached_property
    def _state_parameters(self) -> frozenset[str]:
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
        """Free parameters with analytic derivatives, the states of the effects held.

        Those of the nominal axis, and those of effects on which no state and no sensor depends.
        For `state_dependent` ones the derivatives leave out the change of the states.
        """
        return (
            *self.nominal_parameters,
            *(name for name in self.effect_parameters if name not in self._state_parameters),
        )

    @property
    def by_difference(self) -> tuple[str, ...]:
        """Free parameters of effects on which states or sensors depend as well."""
        return tuple(name for name in self.effect_parameters if name in self._state_parameters)

    @property
    def state_dependent(self) -> tuple[str, ...]:
        """Nominal free parameters on which states of the effects depend."""
        return tuple(name for name in self.nominal_parameters if name in self._state_parameters)

    @property
    def free(self) -> tuple[str, ...]:
        """All free parameters, in the order of every Jacobian."""
        return (*self.analytic, *self.by_difference)

    @property
    def rest(self) -> ca.Function:
        """``-> z``: the effects' states at rest."""
        return self._functions[2]

    def residual(self, N: int) -> ca.Function:
        """``-> (r (ne, N), y (ny, N))``: residuals of the balances, and what the sensors show.

        For N samples, a multiple of `STRETCH`; constants and θ once a stretch.
        """
        return self._repeated(self._functions[0], N // STRETCH, "map", 1)

    def residual_and_jacobian(self, N: int) -> ca.Function:
        """``-> (r, y, ∂r/∂θ_exact (ne, n N))``, as `residual`."""
        return self._repeated(self._functions[1], N // STRETCH, "map", 1)

    def effect_states(self, N: int, B: int) -> ca.Function:
        """Return N samples of the effects' states, for B motions side by side."""
        return self._repeated(self._functions[3], N // STRETCH, "mapaccum", B)

    def _repeated(self, f: ca.Function, count: int, how: str, B: int) -> ca.Function:
        key = (f.name(), count, B)
        if key not in self._kept:
            chain = f if count == 1 else f.map(count) if how == "map" else f.mapaccum("all", count)
            self._kept[key] = chain.map(B) if B > 1 else chain
        return self._kept[key]

    @cached_property
    def _kept(self) -> dict[Any, ca.Function]:
        return {}


def any_sensor_effect(effects: Sequence[Effect]) -> bool:
    """Tell whether an effect acts on a measured output."""
    return any("output" in effect.junctions for effect in effects)


def any_sensor_memory(effects: Sequence[Effect]) -> bool:
    """Tell whether an effect with states acts on a measured output."""
    return any("output" in effect.junctions and effect.states for effect in effects)


def _stretch(name: str, f: ca.Function, K: int, accumulates: bool) -> ca.Function:
    """Return K samples of f in one function; its last two inputs (c, θ) are given once."""
    first = 1 if accumulates else 0
    shapes = [(f.size1_in(i), f.size2_in(i)) for i in range(f.n_in())]
    given = [
        ca.MX.sym(f"a{i}", rows, columns if i < first or i >= len(shapes) - 2 else columns * K)
        for i, (rows, columns) in enumerate(shapes)
    ]
    many = f.mapaccum("chain", K) if accumulates else f.map(K)
    outputs = many.call([*given[:-2], *(ca.repmat(symbol, 1, K) for symbol in given[-2:])])
    if accumulates:  # the state at the end first, which the next stretch begins with
        outputs = [outputs[0][:, -1], outputs[0]]
    return ca.Function(name, given, outputs)
