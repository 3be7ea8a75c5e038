"""The measured flow map as part of the estimation: it fixes the scale of all flows.

Multiplying both flow polynomials and X_s1 ... X_s6 by one constant leaves every trajectory
unchanged. Where they are free together, the measured map has to fix their common scale.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.valve import FlowMap


@dataclass(frozen=True, slots=True, eq=False)
class Anchor:
    """Residuals of the measured map, divided by its noise.

    Parameters
    ----------
    residual : casadi.Function
        ``c (n_c,) -> ((q_m(u, p; c) - q_m) / σ, its Jacobian)`` with one row a measured point.
    names : tuple of str
        The coefficients, in order: those of the flow model, then those of effects that a valve
        has while it is metered.
    fitted : (n_c,) array
        The coefficients of the map's own fit, without effects.
    """

    residual: ca.Function
    names: tuple[str, ...]
    fitted: FloatArray

    @property
    def n(self) -> int:
        """Number of measured points."""
        return int(self.residual.size1_out(0))

    def __call__(self, c: FloatArray) -> FloatArray:
        """Return the residuals, shape (n,)."""
        return np.asarray(self.residual(c)[0], dtype=float).ravel()

    def jacobian(self, c: FloatArray) -> FloatArray:
        """Return the derivatives of the residuals, shape (n, n_c)."""
        return np.asarray(self.residual(c)[1], dtype=float)

    def coefficients(self, parameters: Parameters, theta: FloatArray) -> FloatArray:
        """Return c among the values theta (n,) of all parameters."""
        return theta[[parameters.index(name) for name in self.names]]

    def rows(self, c: FloatArray, free: Sequence[str]) -> FloatArray:
        """Return the derivatives to the parameters `free`, (n, len(free)); zero for no c."""
        derivatives = np.zeros((self.n, len(free)))
        slopes = self.jacobian(c)
        for column, name in enumerate(self.names):
            if name in free:
                derivatives[:, free.index(name)] = slopes[:, column]
        return derivatives


def anchor_to_flow_map(
    table: FlowMap, flow: Any, sigma: float | None = None, effects: Sequence[Effect] = ()
) -> Anchor:
    """Anchor the coefficients of `flow` to the measured `table`.

    Parameters
    ----------
    sigma : float, optional
        Standard deviation of one measured flow [kg/s]; by default the residual of the map's
        own fit, in which the map's noise and the form's misfit both count.
    effects : sequence of Effect, optional
        Those of the axis; the ones that are `metered` bend the map too.
    """
    symbol: Any = ca.MX if flow.symbol == "MX" else ca.SX
    shapes = [effect for effect in effects if effect.metered]
    own = {f"{effect.name}.{item.name}": item for effect in shapes for item in effect.parameters}
    names = (*flow.parameters.names, *own)
    fitted = np.append(flow.parameters.values, [item.null for item in own.values()])
    u, p, q, c = (symbol.sym(s, k) for s, k in (("u", 1), ("p", 1), ("q", 1), ("c", len(names))))
    opening = _opening(u, p, shapes, dict(zip(names, ca.vertsplit(c), strict=True)))
    modelled = flow.expression(opening, p, c[: len(flow.parameters)])
    e = (modelled - q) / (flow.sigma if sigma is None else sigma)
    point = ca.Function("point", [u, p, q, c], [e, ca.densify(ca.jacobian(e, c))])
    n = table.u.size
    coefficients = ca.MX.sym("c", len(names))
    rows = [ca.DM(np.asarray(a)).T for a in (table.u, table.p, table.q_m)]
    e_all, J_all = point.map(n)(*rows, ca.repmat(coefficients, 1, n))
    J = ca.reshape(J_all, len(names), n).T
    return Anchor(ca.Function("map_residual", [coefficients], [e_all.T, J]), names, fitted)


def _opening(
    u: Expression, p: Expression, shapes: Sequence[Effect], values: Mapping[str, Expression]
) -> Expression:
    """Return what a command opens of the valve on the metering bench, where nothing moves."""
    for effect in shapes:
        own = {item.name: values[f"{effect.name}.{item.name}"] for item in effect.parameters}
        at = Scope(0.0, 0.0, Pair(p, p), 0.0, 0.0, {}, own)
        u = effect.spool(Pair(u, u), at).P
    return u
