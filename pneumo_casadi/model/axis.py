"""The axis as CasADi functions: parameters, right-hand side, outputs, regressor."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from pneumo_casadi.data import Bench, ForceBench
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.balances import Balances, write_balances
from pneumo_casadi.model.effect import JUNCTIONS, Effect, Expression
from pneumo_casadi.parameters import FloatArray, Parameter, Parameters

#: Junctions of an axis with chambers, and of one driven by a force.
PNEUMATIC = frozenset(JUNCTIONS) - {"drive"}
FORCE_DRIVEN = frozenset({"drive", "force", "output"})

#: Width that makes tanh the sign function for every velocity that a sensor can tell from zero.
V_S_SHARP = 1e-12

_SCALES = {"p_P": 1e5, "p_N": 1e5, "x": 0.1, "v": 0.5}
_UNITS = {"p_P": "Pa", "p_N": "Pa", "x": "m", "v": "m/s", "u_P": "V", "u_N": "V", "F": "N"}


@dataclass(frozen=True, eq=False)
class Axis:
    """An axis with its effects, ready to be simulated and fitted.

    Use `Servosystem` or `ForceAxis` to make one.

    Parameters
    ----------
    bench : Bench or ForceBench
        Geometry and constants.
    flow : flow model or None
        Static map of the two identical valves; None leaves the chambers out.
    effects : tuple of Effect
        Folded in this order at each junction.
    parameters : Parameters
        Nominal parameters (eq. 9), the friction width ``v_s``, the coefficients of the flow map
        and those of the effects as ``"effect.name"``.
    """

    bench: Bench | ForceBench
    flow: Any
    effects: tuple[Effect, ...]
    parameters: Parameters

    def __post_init__(self) -> None:
        names = [effect.name for effect in self.effects]
        if len(set(names)) < len(names):
            raise ModelError(f"an effect is named twice: {', '.join(names)}")
        allowed = PNEUMATIC if self.flow is not None else FORCE_DRIVEN
        for effect in self.effects:
            missing = [j for j in effect.junctions if j not in allowed]
            if missing:
                kind = "a servo axis" if self.flow is not None else "a force-driven axis"
                raise ModelError(
                    f"effect {effect.name} acts at {', '.join(missing)}, which {kind} has not"
                )
            if effect.needs_chambers and self.flow is None:
                raise ModelError(
                    f"effect {effect.name} needs pressures, which a force-driven axis has not"
                )

    def __getstate__(self) -> dict[str, Any]:
        kept = ("bench", "flow", "effects", "parameters")
        return {name: self.__dict__[name] for name in kept}

    def with_effects(self, *effects: Effect) -> "Axis":
        """Return the axis with further effects, at their null values."""
        added = Parameters(item for effect in effects for item in _effect_parameters(effect))
        return replace(self, effects=(*self.effects, *effects), parameters=self.parameters + added)

    def with_parameters(self, parameters: Parameters | Mapping[str, float]) -> "Axis":
        """Return the axis with other parameter values, bounds or freedom (matched by name)."""
        if not isinstance(parameters, Parameters):
            return replace(self, parameters=self.parameters.with_values(parameters))
        new = {item.name: item for item in parameters}
        return replace(
            self, parameters=Parameters(new.get(item.name, item) for item in self.parameters)
        )

    def at_null_values(self) -> "Axis":
        """Return the axis with all its effects where they vanish, as far as bounds allow."""
        nulls = {item.name: item.null for item in self.parameters if item.null is not None}
        items = self.parameters.select(nulls)
        inside = np.clip(list(nulls.values()), items.lower, items.upper)
        return self.with_parameters(dict(zip(nulls, inside.tolist(), strict=True)))

    def at_starting_values(self, *names: str) -> "Axis":
        """Return the axis with the named effects (all, if none is named) where a fit starts."""
        chosen = names or tuple(effect.name for effect in self.effects)
        unknown = set(chosen) - {effect.name for effect in self.effects}
        if unknown:
            raise ModelError(f"the axis has no effect {', '.join(sorted(unknown))}")
        starts = {
            item.name: item.start
            for item in self.parameters
            if item.start is not None and item.name.split(".")[0] in chosen
        }
        return self.with_parameters(starts)

    def started_at(self, parameters: Parameters) -> "Axis":
        """Return the axis with values from another estimate, moved into this axis' bounds.

        Weighted least squares knows no bounds; output error must start within them.
        """
        known = [item.name for item in parameters if item.name in self.parameters]
        mine = self.parameters.select(known)
        inside = np.clip(parameters.select(known).values, mine.lower, mine.upper)
        return self.with_parameters(dict(zip(known, inside.tolist(), strict=True)))

    @property
    def motion_states(self) -> tuple[str, ...]:
        """States of the nominal axis."""
        return ("p_P", "p_N", "x", "v") if self.flow is not None else ("x", "v")

    @property
    def states(self) -> tuple[str, ...]:
        """All states, those of the effects last as ``"effect.state"``."""
        extra = (f"{e.name}.{state.name}" for e in self.effects for state in e.states)
        return (*self.motion_states, *extra)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Input channels."""
        return ("u_P", "u_N") if self.flow is not None else ("F",)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Measured channels."""
        return ("p_P", "p_N", "x") if self.flow is not None else ("x",)

    @property
    def equations(self) -> tuple[str, ...]:
        """Balances in residual form, in order."""
        chambers = ("mass_flow_P", "mass_flow_N") if self.flow is not None else ()
        return (*chambers, "force")

    @property
    def state_scales(self) -> FloatArray:
        """Sizes by which an optimiser divides the states, shape (nx,)."""
        extra = [state.scale for effect in self.effects for state in effect.states]
        return np.array([*(_SCALES[name] for name in self.motion_states), *extra])

    def unit(self, channel: str) -> str:
        """Return the unit of a state, input or output of the nominal axis."""
        return _UNITS[channel]

    @property
    def symbol(self) -> Any:
        """CasADi type in which the model can be written: SX unless the flow map needs MX."""
        return ca.MX if getattr(self.flow, "symbol", "SX") == "MX" else ca.SX

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
                known, rates, u_by_name, theta, self.constants, self.effects, self.flow
            )

        if not at_rest or self.states == self.motion_states:
            return write(states)
        # A state at rest may hang on one further up the chain (a lag behind a delay), so the
        # rest values are settled by as many passes as there are effects.
        settled = {name: 0.0 for name in self.states if name not in states}
        for _ in self.effects:
            settled = dict(write(states | settled).rest)
        return write(states | settled)

    @property
    def constants(self) -> dict[str, float]:
        """Geometry, pressures and gas of the bench, as far as the axis has them [SI]."""
        if isinstance(self.bench, ForceBench):
            return {} if self.bench.stroke is None else {"stroke": self.bench.stroke}
        names = ("S_P", "S_N", "p_ext", "p_supply", "T", "r", "stroke")
        return {name: getattr(self.bench, name) for name in names}

    def _symbols(self) -> tuple[Expression, Expression, Expression]:
        sym = self.symbol.sym
        return (
            sym("x", len(self.states)),
            sym("u", len(self.inputs)),
            sym("theta", len(self.parameters)),
        )

    def _named(self, theta: Expression) -> dict[str, Expression]:
        return {name: theta[i] for i, name in enumerate(self.parameters.names)}

    @cached_property
    def rhs(self) -> ca.Function:
        """ẋ = f(x, u, θ): the balances solved for the derivatives, (nx,), (nu,), (n,) → (nx,)."""
        x, u, theta = self._symbols()
        dx = self.symbol.sym("dx", len(self.states))
        written = self.balances(x, dx, u, self._named(theta))
        position = self.states.index("v")
        rates = {"x": x[position], **written.rates}
        r = ca.vertcat(*(written.residual[name] for name in self.equations))
        inertia = -ca.jacobian(r, dx)
        rest = ca.substitute(r, dx, ca.DM.zeros(dx.shape))
        for i, state in enumerate([*self.outputs[:-1], "v"]):
            # Each balance holds one derivative, linearly: r = r|₀ - inertia · derivative.
            rates[state] = rest[i] / inertia[i, self.states.index(state)]
        f = ca.vertcat(*(rates[name] for name in self.states))
        if ca.depends_on(f, dx):
            raise ModelError("an effect couples the derivatives of several states; solve it there")
        return ca.Function("rhs", [x, u, theta], [f], ["x", "u", "theta"], ["dx"])

    @cached_property
    def output(self) -> ca.Function:
        """Y = h(x, u, θ): what the sensors show, (nx,), (nu,), (n,) → (ny,)."""
        x, u, theta = self._symbols()
        written = self.balances(x, self.symbol(x.shape[0], 1), u, self._named(theta))
        y = ca.vertcat(*(written.output[name] for name in self.outputs))
        return ca.Function("output", [x, u, theta], [y], ["x", "u", "theta"], ["y"])

    @cached_property
    def valve_flow(self) -> ca.Function:
        """q_m = (q_mP, q_mN) through the valves [kg/s], (nx,), (nu,), (n,) → (2,)."""
        x, u, theta = self._symbols()
        written = self.balances(x, self.symbol(x.shape[0], 1), u, self._named(theta))
        q_m = ca.vertcat(*written.q_m)
        return ca.Function("valve_flow", [x, u, theta], [q_m], ["x", "u", "theta"], ["q_m"])

    @cached_property
    def rest(self) -> ca.Function:
        """States with those of the effects at rest: (n motion states,), (nu,), (n,) → (nx,)."""
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
            The effects' own states are at rest: a regressor knows no lag.

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
        sym = self.symbol.sym
        x, dx = (sym(name, len(self.motion_states)) for name in ("x", "dx"))
        u = sym("u", len(self.inputs))
        theta = sym("theta", len(chosen))
        values = (parameters or self.parameters).as_dict() | {"v_s": V_S_SHARP}
        named: dict[str, Expression] = {**values, **{n: theta[i] for i, n in enumerate(chosen)}}
        written = self.balances(x, dx, u, named, at_rest=True)
        r = ca.vertcat(*(written.residual[name] for name in self.equations))
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

    @property
    def regressor_names(self) -> tuple[str, ...]:
        """Free parameters that enter the balances linearly, those of the flow map excepted.

        All nominal ones, and of each effect without states those that are linear beside the
        ones before them: a shape parameter inside a column is held at its value instead, and
        one that only a sensor knows is no business of the balances.
        """
        flow = set(self.flow.parameters.names) if self.flow is not None else set()
        lagging = {effect.name for effect in self.effects if effect.states}
        x, u, theta = self._symbols()
        dx = self.symbol.sym("dx", len(self.states))
        written = self.balances(x, dx, u, self._named(theta))
        J = ca.jacobian(ca.vertcat(*written.residual.values()), theta)
        names = self.parameters.names
        chosen = [n for n in self.parameters.free_names if n not in flow and n != "v_s"]
        found = [n for n in chosen if "." not in n]
        for name in chosen:
            column = J[:, self.parameters.index(name)]
            if "." not in name or name.split(".")[0] in lagging or column.nnz() == 0:
                continue
            seen = {names[i] for i in _dependence(column, theta)}
            if not seen & {*found, name}:
                found.append(name)
        return tuple(found)


def _dependence(expression: Expression, vector: Expression) -> list[int]:
    """Return the elements of a symbolic vector on which an expression depends."""
    pattern = ca.jacobian_sparsity(ca.vec(expression), vector)
    return sorted(set(pattern.get_col()))


def _effect_parameters(effect: Effect) -> list[Parameter]:
    return [replace(item, name=f"{effect.name}.{item.name}") for item in effect.parameters]
