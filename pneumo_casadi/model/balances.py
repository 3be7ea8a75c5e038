"""The balances of the axis, written once, in residual form, with the effects folded in.

The mass balances of the chambers P and N, which give their pressures (eq. 1), the force of the
ambient pressure (eq. 2), the volumes (eq. 3) and friction in the force balance (eq. 4). Everything
else - simulation, regressor, sensitivities - is derived from `write_balances`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca

from pneumo_casadi.data import AxisKind
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.friction_law import friction_force, smoothed_sign
from pneumo_casadi.model.junctions import Expression, Pair, Supply
from pneumo_casadi.valve.flow_pair import valve_of

#: Lower limit of the pressure at a port of the valve after all effects [Pa].
P_LEAST = 1e3
#: Dead length of a chamber [strokes].
DEAD_LENGTH = 0.05


@dataclass(frozen=True, slots=True)
class Balances:
    """Residual expressions of an axis; all are zero on a trajectory of the model.

    Parameters
    ----------
    residual : dict of str to Expression
        ``mass_flow_P``, ``mass_flow_N`` [kg/s] where the axis has chambers, ``force`` [N].
    rates : dict of str to Expression
        Rates of the effects' states, by full name ``"effect.state"``.
    rest : dict of str to Expression
        Values at which the effects' states are at rest, by full name.
    renewed : dict of str to Expression
        Values of the sampled states after a sample, by full name; see `State.sampled`.
    output : dict of str to Expression
        What the sensors show, by channel.
    q_m : Pair
        Flow through the valves [kg/s]; zeros without chambers.
    inertia : dict of str to Expression
        Factor of the rate in each balance of the nominal axis: the capacity of a chamber [kg/Pa],
        and M [kg]. Where sensors do not sit at the chambers, at most the isothermal capacity of
        their geometry: the balance at the sensor would not forbid that it grows.
    """

    residual: Mapping[str, Expression]
    rates: Mapping[str, Expression]
    rest: Mapping[str, Expression]
    renewed: Mapping[str, Expression]
    output: Mapping[str, Expression]
    q_m: Pair
    inertia: Mapping[str, Expression]


@dataclass
class _Fold:
    """Passes values through the effects and keeps the value that arrived at each of them."""

    effects: Sequence[Effect]
    scopes: Sequence[Scope]
    entering: list[dict[str, Any]] = field(init=False)

    def __post_init__(self) -> None:
        self.entering = [{} for _ in self.effects]
        pairs = zip(self.scopes, self.entering, strict=True)
        self.scopes = [replace(scope, entering=seen) for scope, seen in pairs]

    def through(self, junction: str, value: Any) -> Any:
        for effect, scope, seen in zip(self.effects, self.scopes, self.entering, strict=True):
            if junction in effect.junctions:
                seen[junction] = value
                value = getattr(effect, junction)(value, scope)
        return value


def write_balances(
    kind: AxisKind,
    x: Mapping[str, Expression],
    dx: Mapping[str, Expression],
    u: Mapping[str, Expression],
    theta: Mapping[str, Expression],
    constants: Mapping[str, float],
    effects: Sequence[Effect],
    flow: Any = None,
) -> Balances:
    """Write eq. 1-4 of the axis with its effects as residuals.

    On an axis with chambers::

        0 = q_mP - (X_s1 + X_s2 x) ṗ_P - X_s3 p_P ẋ
        0 = q_mN - (X_s4 - X_s5 x) ṗ_N + X_s6 p_N ẋ
        0 = S_P p_P - S_N p_N - F_ext - M ẍ - F_f(ẋ)

    and on one driven by a force: 0 = F - M ẍ - F_f(ẋ). A load adds M g_x + F_0 + F_load to the
    forces: gravity along +x, a constant force, and a measured force on the rod.

    Parameters
    ----------
    kind : AxisKind
        Which states, inputs and balances there are.
    x, dx : mapping of str to Expression
        States and their derivatives: ``p_P, p_N`` [Pa] (with chambers), ``x`` [m], ``v`` [m/s],
        and the effects' states as ``"effect.state"``. A missing effect state is at rest.
    u : mapping of str to Expression
        Inputs: ``u_P, u_N`` [V], ``F`` [N], or the measured pressures ``p_P, p_N`` [Pa]; where
        they are recorded, ``p_supply`` [Pa] and ``F_load`` [N].
    theta : mapping of str to Expression
        Parameters by name.
    constants : mapping of str to float
        ``S_P, S_N, p_ext, p_supply, T, r, stroke``, as far as the axis has them; under a load
        the component of gravity along +x ``g_x`` [m/s²] and a constant force ``F_0`` [N].
    effects : sequence of Effect
        In the order in which they are folded.
    flow : flow model, optional
        Static map of the valves with ``parameters``, ``expression(u, p, theta)`` and, where an
        effect changes the port pressures, ``expression_at``. Needed with chambers.

    Returns
    -------
    Balances
    """
    signals = {**u, **x}
    p = _chamber_pressures(kind, signals, constants)
    direction = smoothed_sign(x["v"], theta["v_s"])
    friction = friction_force(x["v"], direction, theta)
    nominal = {**{k: val for k, val in theta.items() if "." not in k}, **constants}
    nominal |= {name: u[name] for name in ("p_supply",) if name in u}
    common = Scope(x["x"], x["v"], p, direction, friction, nominal, inputs=u)
    owns = [_own(effect, x, theta) for effect in effects]
    fold = _Fold(effects, [replace(common, own=own) for own in owns])

    p_c = p
    if kind.gas_chambers:
        p_c = fold.through("chamber_pressure", p)
        fold.scopes = [replace(scope, p=p_c) for scope in fold.scopes]
    inside = signals if p_c is p else {**signals, "p_P": p_c.P, "p_N": p_c.N}
    residual: dict[str, Expression] = {}
    inertia: dict[str, Expression] = {"force": theta["M"]}
    q_m = Pair(0.0, 0.0)
    if kind.gas_chambers:
        q_m = _valve_flow(fold, u, p, theta, constants, flow)
        q = fold.through("chamber_flow", fold.through("line", q_m))
        q = fold.through("chamber_energy", q)
        C = chamber_capacities(x["x"], theta)
        at_sensor = fold.through("capacity", C)
        residual |= mass_flow_residuals(q, at_sensor, p_c, x, dx, theta)
        C = C if at_sensor is C else _at_most_isothermal(C, x["x"], constants)
        inertia |= {"mass_flow_P": C.P, "mass_flow_N": C.N}
    driving = fold.through("drive", driving_force(kind, inside, nominal))
    loaded = driving - friction + load_force(signals, theta["M"], constants)
    force = fold.through("force", loaded)
    residual["force"] = force - theta["M"] * dx["v"]

    shown = {**signals, "a": force / theta["M"]} if "a" in kind.outputs else signals
    output = fold.through("output", {name: shown[name] for name in kind.outputs})
    rates: dict[str, Expression] = {}
    rest: dict[str, Expression] = {}
    renewed: dict[str, Expression] = {}
    for effect, entering, scope in zip(effects, fold.entering, fold.scopes, strict=True):
        if not effect.states:
            continue
        sampled = [state for state in effect.states if state.sampled]
        moving = [state for state in effect.states if not state.sampled]
        rates |= {f"{effect.name}.{state.name}": 0.0 for state in sampled}
        rates |= _full(effect, "rates", moving, effect.rates(entering, scope))
        rest |= _full(effect, "rest", effect.states, effect.rest(entering, scope))
        if sampled:
            renewed |= _full(effect, "renewed", sampled, effect.renewed(entering, scope))
    return Balances(residual, rates, rest, renewed, output, q_m, inertia)


def mass_flow_residuals(
    q: Pair,
    capacity: Pair,
    p: Pair,
    x: Mapping[str, Expression],
    dx: Mapping[str, Expression],
    theta: Mapping[str, Expression],
) -> dict[str, Expression]:
    """Return the residuals of both mass flow balances of eq. 1 [kg/s].

    ``q`` is the flow that raises the pressures: k r T / V (q_m ∓ S/(r T) p ẋ) = ṗ, written with
    the parameters of eq. 10 and 11; `capacity` is V/(k r T) of either chamber.
    """
    return {
        "mass_flow_P": q.P - capacity.P * dx["p_P"] - theta["X_s3"] * p.P * x["v"],
        "mass_flow_N": q.N - capacity.N * dx["p_N"] + theta["X_s6"] * p.N * x["v"],
    }


def chamber_capacities(x: Expression, theta: Mapping[str, Expression]) -> Pair:
    """Return V_P(x)/(k_P r T) and V_N(x)/(k_N r T) [kg/Pa].

    Eq. 3: V_P(x) = V_P(0) + S_P x and V_N(x) = V_N(0) - S_N x.
    """
    return Pair(theta["X_s1"] + theta["X_s2"] * x, theta["X_s4"] - theta["X_s5"] * x)


def _at_most_isothermal(capacity: Pair, x: Expression, constants: Mapping[str, Expression]) -> Pair:
    """Return the capacities, where they are larger those of the geometry at k = 1."""
    if "stroke" not in constants:
        return capacity
    length = (0.5 + DEAD_LENGTH) * constants["stroke"]
    rT = constants["r"] * constants["T"]
    P, N = constants["S_P"] * (length + x) / rT, constants["S_N"] * (length - x) / rT
    return Pair(ca.fmin(capacity.P, P), ca.fmin(capacity.N, N))


def driving_force(
    kind: AxisKind, signals: Mapping[str, Expression], geometry: Mapping[str, Expression]
) -> Expression:
    """Return what moves the mass of the nominal axis: S_P p_P - S_N p_N - F_ext, or F [N].

    `geometry` holds the piston areas [m²] and the ambient pressure [Pa].
    """
    if kind.chambers:
        p = _chamber_pressures(kind, signals, geometry)
        return pressure_force(p, geometry) - external_force(geometry)
    return signals["F"]


def load_force(
    signals: Mapping[str, Expression], M: Expression, constants: Mapping[str, Expression]
) -> Expression:
    """Return M g_x + F_0 + F_load [N], as far as the axis has them, else 0."""
    force: Expression = 0.0
    if "g_x" in constants:
        force = force + M * constants["g_x"]
    if "F_0" in constants:
        force = force + constants["F_0"]
    return force + signals["F_load"] if "F_load" in signals else force


def _chamber_pressures(
    kind: AxisKind, signals: Mapping[str, Expression], constants: Mapping[str, Expression]
) -> Pair:
    """Return the pressures of both chambers; an open one is at the ambient pressure."""
    if not kind.chambers:
        return Pair(0.0, 0.0)
    return Pair(*(signals.get(f"p_{c}", constants["p_ext"]) for c in ("P", "N")))


def pressure_force(p: Pair, constants: Mapping[str, Expression]) -> Expression:
    """Return the force of the chamber pressures on the piston, S_P p_P - S_N p_N [N] (eq. 1)."""
    return constants["S_P"] * p.P - constants.get("S_N", 0.0) * p.N


def external_force(constants: Mapping[str, Expression]) -> Expression:
    """Return the force of the ambient pressure on the rod [N].

    Eq. 2: F_ext = (S_P - S_N) p_ext.
    """
    return (constants["S_P"] - constants.get("S_N", 0.0)) * constants["p_ext"]


def _valve_flow(
    fold: _Fold,
    u: Mapping[str, Expression],
    p: Pair,
    theta: Mapping[str, Expression],
    constants: Mapping[str, float],
    flow: Any,
) -> Pair:
    """Fold the command through valve and ports to the flow through each valve."""
    opening = fold.through("spool", fold.through("command", Pair(u["u_P"], u["u_N"])))
    metered = Supply(constants["p_supply"], constants["p_ext"])
    recorded = Supply(u["p_supply"], constants["p_ext"]) if "p_supply" in u else metered
    ports = fold.through("supply", recorded)
    outlet = fold.through("outlet", p)
    coefficients = ca.vertcat(*(theta[name] for name in flow.parameters.names))

    def q_m(chamber: str, voltage: Expression, pressure: Expression) -> Expression:
        valve, rows = valve_of(flow, chamber)
        if ports is metered:
            return valve.expression(voltage, pressure, coefficients[rows])
        filling = ca.fmax(ports.p_supply, P_LEAST) / metered.p_supply
        emptying = ca.fmax(ports.p_ext, P_LEAST) / metered.p_ext
        return valve.expression_at(voltage, pressure, coefficients[rows], filling, emptying)

    q = Pair(q_m("P", opening.P, outlet.P), q_m("N", opening.N, outlet.N))
    return Pair(*fold.through("valve_flow", q))


def _own(
    effect: Effect, x: Mapping[str, Expression], theta: Mapping[str, Expression]
) -> dict[str, Expression]:
    """Collect an effect's parameters and states under their short names."""
    own = {item.name: theta[f"{effect.name}.{item.name}"] for item in effect.parameters}
    return own | {item.name: x[f"{effect.name}.{item.name}"] for item in effect.states}


def _full(
    effect: Effect, method: str, states: Sequence[State], values: Mapping[str, Expression]
) -> dict[str, Expression]:
    """Give state values their full names, in the declared order; refuse missing and other ones."""
    names = [state.name for state in states]
    if set(names) != set(values):
        raise ModelError(
            f"effect {effect.name}: `{method}` returns {', '.join(values) or 'nothing'}, expected "
            f"{', '.join(names) or 'nothing'}: sampled states have no rates, and only they are "
            "renewed"
        )
    return {f"{effect.name}.{name}": values[name] for name in names}
