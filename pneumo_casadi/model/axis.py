"""The axis as CasADi functions: right-hand side, outputs, regressor."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Self

import casadi as ca
import numpy as np

from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.axis_description import AxisDescription
from pneumo_casadi.model.balances import Balances, driving_force, load_force, write_balances
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import FloatArray, Parameters

#: Width that makes tanh the sign function for every velocity that a sensor can tell from zero.
V_S_SHARP = 1e-12


class Axis(AxisDescription):
    """An axis with its effects, ready to be simulated and fitted.

    Use `Servosystem`, `ForceAxis` or `make_axis` to make one.

    Parameters
    ----------
    bench, flow, effects, parameters
        See `AxisDescription`.
    """

    def with_parameters(self, parameters: Parameters | Mapping[str, float]) -> Self:
        """Return the axis with other parameter values, bounds or freedom (matched by name)."""
        other = super().with_parameters(parameters)
        # Its functions are those of this axis: values are symbols in them.
        other.__dict__["_written"] = self._written
        return other

    @cached_property
    def _written(self) -> dict[str, ca.Function]:
        """Functions written so far, for all axes that differ in their parameters' values alone."""
        return {}

    def _once(self, name: str, write: Callable[[], ca.Function]) -> ca.Function:
        if name not in self._written:
            self._written[name] = write()
        return self._written[name]

    def balances(
        self,
        x: Expression,
        dx: Expression,
        u: Expression,
        theta: Mapping[str, Expression],
        at_rest: bool = False,
    ) -> Balances:
        """Write the balances for vectors of states (nx,), derivatives (nx,) and inputs (nu,).

        With `at_rest`, `x` and `dx` hold the nominal states only and the effects' own states
        take the values at which they are at rest.
        """
        names = self.motion_states if at_rest else self.states
        states = {name: x[i] for i, name in enumerate(names)}
        rates = {name: dx[i] for i, name in enumerate(names)}
        u_by_name = {name: u[i] for i, name in enumerate(self.inputs)}

        def write(known: Mapping[str, Expression]) -> Balances:
            return write_balances(
                self.kind, known, rates, u_by_name, theta, self.constants, self.effects, self.flow
            )

        if not at_rest or self.states == self.motion_states:
            return write(states)
        # A state at rest may depend on one before it in the chain (a lag behind a delay). As many
        # passes as there are effects therefore give the rest values.
        settled = {name: 0.0 for name in self.states if name not in states}
        for _ in self.effects:
            settled = dict(write(states | settled).rest)
        return write(states | settled)

    def _symbols(self) -> tuple[Expression, Expression, Expression]:
        sym = self.symbol.sym
        return (
            sym("x", len(self.states)),
            sym("u", len(self.inputs)),
            sym("theta", len(self.parameters)),
        )

    def _named(self, theta: Expression) -> dict[str, Expression]:
        return {name: theta[i] for i, name in enumerate(self.parameters.names)}

    @property
    def rhs(self) -> ca.Function:
        """ẋ = f(x, u, θ): the balances solved for the derivatives, (nx,), (nu,), (n,) → (nx,)."""
        return self._once("rhs", self._write_rhs)

    def _write_rhs(self) -> ca.Function:
        x, u, theta = self._symbols()
        dx = self.symbol.sym("dx", len(self.states))
        written = self.balances(x, dx, u, self._named(theta))
        position = self.states.index("v")
        rates = {"x": x[position], **written.rates}
        r = ca.vertcat(*(written.residual[name] for name in self.equations))
        inertia = -ca.jacobian(r, dx)
        rest = ca.substitute(r, dx, ca.DM.zeros(dx.shape))
        for i, balance in enumerate(self.kind.balances):
            # Each balance holds one derivative, linearly: r = r|₀ - inertia · derivative.
            rates[balance.state] = rest[i] / inertia[i, self.states.index(balance.state)]
        f = ca.vertcat(*(rates[name] for name in self.states))
        if ca.depends_on(f, dx):
            raise ModelError("an effect couples the derivatives of several states; solve it there")
        return ca.Function("rhs", [x, u, theta], [f], ["x", "u", "theta"], ["dx"])

    @property
    def sampled_states(self) -> tuple[str, ...]:
        """States that jump from sample to sample, see `State.sampled`."""
        return tuple(
            f"{effect.name}.{state.name}"
            for effect in self.effects
            for state in effect.states
            if state.sampled
        )

    @property
    def renewed(self) -> ca.Function:
        """States after a sample, sampled ones as they are then: (nx,), (nu,), (n,) → (nx,)."""
        return self._once("renewed", self._write_renewed)

    def _write_renewed(self) -> ca.Function:
        x, u, theta = self._symbols()
        written = self.balances(x, self.symbol(x.shape[0], 1), u, self._named(theta))
        after = [written.renewed.get(name, x[i]) for i, name in enumerate(self.states)]
        names = ["x", "u", "theta"]
        return ca.Function("renewed", [x, u, theta], [ca.vertcat(*after)], names, ["x_renewed"])

    @property
    def slopes(self) -> ca.Function:
        """∂f/∂x, (nx,), (nu,), (n,) → (nx, nx)."""
        return self._once("slopes", self._write_slopes)

    def _write_slopes(self) -> ca.Function:
        x, u, theta = self._symbols()
        A = ca.jacobian(self.rhs(x, u, theta), x)
        return ca.Function("slopes", [x, u, theta], [A], ["x", "u", "theta"], ["A"])

    @property
    def output(self) -> ca.Function:
        """Y = h(x, u, θ): what the sensors show, (nx,), (nu,), (n,) → (ny,)."""
        return self._once("output", self._write_output)

    def _write_output(self) -> ca.Function:
        x, u, theta = self._symbols()
        written = self.balances(x, self.symbol(x.shape[0], 1), u, self._named(theta))
        y = ca.vertcat(*(written.output[name] for name in self.outputs))
        return ca.Function("output", [x, u, theta], [y], ["x", "u", "theta"], ["y"])

    @property
    def valve_flow(self) -> ca.Function:
        """q_m = (q_mP, q_mN) through the valves [kg/s], (nx,), (nu,), (n,) → (2,)."""
        return self._once("valve_flow", self._write_valve_flow)

    def _write_valve_flow(self) -> ca.Function:
        x, u, theta = self._symbols()
        written = self.balances(x, self.symbol(x.shape[0], 1), u, self._named(theta))
        q_m = ca.vertcat(*written.q_m)
        return ca.Function("valve_flow", [x, u, theta], [q_m], ["x", "u", "theta"], ["q_m"])

    def driving_force(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """Return what drives the mass, load included [N], (N,), at states (nx, N), inputs (nu, N).

        S_P p_P - S_N p_N - F_ext, or F, of the nominal axis.
        """
        signals = dict(zip(self.motion_states, x, strict=False)) | dict(
            zip(self.inputs, u, strict=True)
        )
        constants = self.constants
        values = self.parameters.as_dict()
        driving = driving_force(self.kind, signals, {**values, **constants})
        return np.asarray(driving + load_force(signals, values["M"], constants))

    @property
    def rest(self) -> ca.Function:
        """States with those of the effects at rest: (n motion states,), (nu,), (n,) → (nx,)."""
        return self._once("rest", self._write_rest)

    def _write_rest(self) -> ca.Function:
        _, u, theta = self._symbols()
        x = self.symbol.sym("x", len(self.motion_states))
        written = self.balances(x, self.symbol(x.shape[0], 1), u, self._named(theta), at_rest=True)
        full = ca.vertcat(x, *(written.rest[name] for name in self.states[x.shape[0] :]))
        return ca.Function("rest", [x, u, theta], [full], ["x", "u", "theta"], ["x_full"])

    def regressor(
        self, names: Sequence[str] | None = None, parameters: Parameters | None = None
    ) -> ca.Function:
        """Derive the regressor of eq. 7 from the balances.

        Parameters
        ----------
        names : sequence of str, optional
            Parameters to be estimated; by default `regressor_names`.
        parameters : Parameters, optional
            Values of all others; by default the axis' own.

        Returns
        -------
        casadi.Function
            ``(x, dx, u) -> (Y, W)`` with the nominal states (``motion_states``), Y of shape
            (ne,) and W of shape (ne, len(names)), such that the balances read Y = W θ.
            The effects' own states are at rest: a regressor contains no dynamics of effects. An
            effect that acts through its states alone is left out.

        Raises
        ------
        ModelError
            If the balances are not linear in one of the names.

        Examples
        --------
        >>> from pneumo_casadi.data import ForceBench, NestedController
        >>> from pneumo_casadi.model.servosystem import ForceAxis
        >>> axis = ForceAxis(ForceBench(1e3, 0.5, NestedController(30.0, 60.0, 1.0, 60.0)))
        >>> Y, W = axis.regressor()([0.0, 0.2], [0.2, 3.0], [50.0])
        >>> float(Y), (W.full() + 0.0).tolist()
        (50.0, [[3.0, 0.2, 1.0, 0.0]])
        """
        chosen = tuple(names) if names is not None else self.regressor_names
        if parameters is not None:
            return self._write_regressor(chosen, parameters)
        if chosen not in self._regressors:  # many records ask for the same one
            self._regressors[chosen] = self._write_regressor(chosen, self.parameters)
        return self._regressors[chosen]

    @cached_property
    def _regressors(self) -> dict[tuple[str, ...], ca.Function]:
        return {}

    def _write_regressor(self, chosen: tuple[str, ...], parameters: Parameters) -> ca.Function:
        theta = self.symbol.sym("theta", len(chosen))
        (x, dx, u), r = self._motion_balances(chosen, theta, parameters)
        W = -ca.jacobian(r, theta)
        nonlinear = [chosen[i] for i in _dependence(W, theta)]
        if nonlinear:
            raise ModelError(
                f"the balances are not linear in {', '.join(nonlinear)}: "
                "leave them out of the regression, or fix them"
            )
        Y = ca.substitute(r, theta, ca.DM.zeros(len(chosen)))
        return ca.Function(
            "regressor", [x, dx, u], [Y, ca.densify(W)], ["x", "dx", "u"], ["Y", "W"]
        )

    @cached_property
    def flow_slopes(self) -> ca.Function:
        """How the flow coefficients change the balances at the states of a regressor.

        ``(x, dx, u) -> D``, (ne, n_c): derivatives of Y (eq. 7) to the coefficients of the flow
        map, at the values of all parameters.
        """
        names = self.flow_parameters
        c = self.symbol.sym("c", len(names))
        signals, r = self._motion_balances(names, c, self.parameters)
        D = ca.substitute(ca.jacobian(r, c), c, ca.DM([self.parameters[n].value for n in names]))
        return ca.Function("flow_slopes", [*signals], [ca.densify(D)], ["x", "dx", "u"], ["D"])

    def _motion_balances(
        self, names: Sequence[str], theta: Expression, parameters: Parameters
    ) -> tuple[tuple[Expression, Expression, Expression], Expression]:
        """Return (x, dx, u) and the balances of the nominal states, with `theta` for `names`.

        All other parameters have their values; the effects' own states are at rest.
        """
        sym = self.symbol.sym
        x, dx = (sym(name, len(self.motion_states)) for name in ("x", "dx"))
        u = sym("u", len(self.inputs))
        values = parameters.as_dict() | {"v_s": V_S_SHARP}
        named: dict[str, Expression] = {**values, **{n: theta[i] for i, n in enumerate(names)}}
        direct = tuple(effect for effect in self.effects if not effect.through_states)
        written = replace(self, effects=direct).balances(x, dx, u, named, at_rest=True)
        r = ca.vertcat(*(written.residual[name] for name in self.equations))
        return (x, dx, u), r

    @property
    def regressor_names(self) -> tuple[str, ...]:
        """Free parameters that enter the balances linearly, those of the flow map excepted.

        These are all nominal parameters, and those parameters of effects without states in which
        the balances are linear together with the parameters chosen before. A shape parameter
        within a column of the regressor is held at its value. Parameters that act on a sensor
        only are not in the balances.
        """
        flow = set(self.flow_parameters)
        lagging = {effect.name for effect in self.effects if effect.states}
        x, u, theta = self._symbols()
        dx = self.symbol.sym("dx", len(self.states))
        written = self.balances(x, dx, u, self._named(theta))
        J = ca.jacobian(ca.vertcat(*written.residual.values()), theta)
        names = self.parameters.names
        chosen = [n for n in self.parameters.free_names if n not in flow and n != "v_s"]
        kept = [n for n in chosen if "." not in n]
        for name in chosen:
            column = J[:, self.parameters.index(name)]
            if "." not in name or name.split(".")[0] in lagging or column.nnz() == 0:
                continue
            seen = {names[i] for i in _dependence(column, theta)}
            if not seen & {*kept, name}:
                kept.append(name)
        return tuple(kept)


def _dependence(expression: Expression, vector: Expression) -> list[int]:
    """Return the elements of a symbolic vector on which an expression depends."""
    pattern = ca.jacobian_sparsity(ca.vec(expression), vector)
    return sorted(set(pattern.get_col()))
