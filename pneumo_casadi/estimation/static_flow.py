"""The flow of a valve on the metering bench, where nothing moves."""

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.valve import FlowISO6358, FlowMap


def metered_flow(flow: Any, effects: Sequence[Effect]) -> tuple[ca.Function, tuple[str, ...]]:
    """Return the static flow of a valve at any supply pressure, and the names of its coefficients.

    Parameters
    ----------
    flow : FlowModel
        The form of the map.
    effects : sequence of Effect
        Those that are `metered` bend the map; their parameters follow the form's coefficients.

    Returns
    -------
    casadi.Function, tuple of str
        ``(u [V], p [Pa], filling [1], c (n_c,)) -> q_m [kg/s]``, and the names of c; see
        `metered_filling`.
    """
    symbol: Any = ca.MX if flow.symbol == "MX" else ca.SX
    shapes = [effect for effect in effects if effect.metered]
    own = [f"{effect.name}.{item.name}" for effect in shapes for item in effect.parameters]
    names = (*flow.parameters.names, *own)
    u, p, filling = (symbol.sym(name) for name in ("u", "p", "filling"))
    c = symbol.sym("c", len(names))
    opening = _opening(u, p, shapes, dict(zip(names, ca.vertsplit(c), strict=True)))
    coefficients = c[: len(flow.parameters)]
    if isinstance(flow, FlowISO6358):
        q = flow.expression_at(opening, p, coefficients, filling, 1.0)
    else:  # holds at the supply pressure of its map
        q = flow.expression(opening, p, coefficients)
    return ca.Function("metered_flow", [u, p, filling, c], [q]), names


def metered_filling(table: FlowMap, flow: Any) -> FloatArray:
    """Return the supply pressure of each metered point over that of the form, shape (n,).

    Raises
    ------
    CaseError
        If supply pressures are mixed and the form holds at one.
    """
    if not isinstance(flow, FlowISO6358):
        table.require_one_supply()
        return np.ones(table.n)
    supply = flow.p_supply if table.p_supply is None else table.p_supply
    return np.broadcast_to(np.asarray(supply) / flow.p_supply, (table.n,))


def static_flow(flow: Any, effects: Sequence[Effect]) -> tuple[ca.Function, tuple[str, ...]]:
    """Return the static flow at the supply pressure of the form; otherwise as `metered_flow`.

    Returns
    -------
    casadi.Function, tuple of str
        ``(u [V], p [Pa], c (n_c,)) -> q_m [kg/s]``, and the names of c.
    """
    function, names = metered_flow(flow, effects)
    symbol: Any = ca.MX if flow.symbol == "MX" else ca.SX
    u, p, c = symbol.sym("u"), symbol.sym("p"), symbol.sym("c", len(names))
    return ca.Function("static_flow", [u, p, c], [function(u, p, 1.0, c)]), names


def _opening(
    u: Expression, p: Expression, shapes: Sequence[Effect], values: Mapping[str, Expression]
) -> Expression:
    """Return what a command opens of the valve on the metering bench, where nothing moves."""
    for effect in shapes:
        own = {item.name: values[f"{effect.name}.{item.name}"] for item in effect.parameters}
        at = Scope(0.0, 0.0, Pair(p, p), 0.0, 0.0, {}, own)
        u = effect.spool(Pair(u, u), at).P
    return u
