"""What fixes the scale of all flows: a measured flow map, or piston areas and a data sheet.

Multiplying both flow polynomials and X_s1 ... X_s6 by one constant leaves every trajectory
unchanged. Where they are free together, something else has to fix their common scale. Its
residuals belong to the same problem:

- a metered map: its points, each with the scatter of the map. A common factor of all of them is
  known to the stated accuracy of the flow meter, exactly where none is stated;
- an unmetered valve: X_s3 = S_P/(r T) and X_s6 = S_N/(r T) to the accuracy of the piston areas, and
  what is known of the valve's coefficients (`pneumo_casadi.valve.data_sheet`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from pneumo_casadi.data import Bench
from pneumo_casadi.estimation.flow_scale import meter_accuracies
from pneumo_casadi.estimation.static_flow import metered_filling, metered_flow
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.model.machine_code.calls import call_with_arrays
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.valve import AnyFlowMap, FlowMap, FlowMapPair
from pneumo_casadi.valve.flow_pair import valve_of


@dataclass(frozen=True, slots=True, eq=False)
class Anchor:
    """Residuals of what is known of the flow besides the records, divided by their noise.

    Parameters
    ----------
    residual : casadi.Function
        ``c (n_c,) -> (residuals, their Jacobian)``: of a map (q_m(u, p; c) - q_m) / σ with one
        row a measured point, then the rows of prior knowledge.
    names : tuple of str
        The coefficients, in order: those of the flow model, those of effects that a valve
        has while it is metered, and other parameters that are known beforehand.
    fitted : (n_c,) array
        The coefficients before any record is seen, without effects.
    n_prior : int, optional
        Number of rows of prior knowledge, the last ones. Their scatter cannot be seen in their
        residuals: it is 1 by definition.
    scatter : casadi.Function or None, optional
        ``c -> (residuals of the measured points alone, before a common factor is taken out,
        their Jacobian)``; None without a map.
    """

    residual: ca.Function
    names: tuple[str, ...]
    fitted: FloatArray
    n_prior: int = 0
    scatter: ca.Function | None = None

    @property
    def n(self) -> int:
        """Number of residuals."""
        return int(self.residual.size1_out(0))

    @property
    def n_points(self) -> int:
        """Number of measured points among them."""
        return self.n - self.n_prior

    def __call__(self, c: FloatArray) -> FloatArray:
        """Return the residuals, shape (n,)."""
        return self._at(c)[0].ravel()

    def jacobian(self, c: FloatArray) -> FloatArray:
        """Return the derivatives of the residuals, shape (n, n_c)."""
        return self._at(c)[1]

    def _at(self, c: FloatArray) -> tuple[FloatArray, ...]:
        return _evaluate(self.residual, np.asarray(c, dtype=float).tobytes())

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


@lru_cache(maxsize=8)
def _evaluate(residual: ca.Function, c: bytes) -> tuple[FloatArray, ...]:
    """Return residuals and Jacobian, kept for a while: a fit asks for both, and twice, at a point.

    The arrays are used by several and must not be written to.
    """
    values = call_with_arrays(residual, np.frombuffer(c))
    for array in values:
        array.setflags(write=False)
    return values


def anchor_to_flow_map(
    table: FlowMap,
    flow: Any,
    sigma: float | None = None,
    effects: Sequence[Effect] = (),
    accuracy: float | None = None,
) -> Anchor:
    """Anchor the coefficients of `flow` to the measured `table`.

    Parameters
    ----------
    sigma : float, optional
        Standard deviation of one measured flow [kg/s]; by default the residual of the map's
        own fit, in which the map's noise and the form's misfit both count.
    effects : sequence of Effect, optional
        Those of the axis; the ones that are `metered` bend the map too.
    accuracy : float, optional
        Relative standard uncertainty of a factor common to all measured flows. None takes the
        factor as known.

    Raises
    ------
    CaseError
        If supply pressures are mixed and the form holds at one.
    """
    function, names = metered_flow(flow, effects)
    nulls = [item.null for effect in effects if effect.metered for item in effect.parameters]
    fitted = np.array([*flow.parameters.values, *nulls], dtype=float)
    symbol: Any = ca.MX if flow.symbol == "MX" else ca.SX
    u, p, filling, q = (symbol.sym(name) for name in ("u", "p", "filling", "q"))
    c = symbol.sym("c", len(names))
    e = (function(u, p, filling, c) - q) / (flow.sigma if sigma is None else sigma)
    point = ca.Function("point", [u, p, filling, q, c], [e, ca.densify(ca.jacobian(e, c))])
    n = table.u.size
    coefficients = ca.MX.sym("c", len(names))
    columns = (table.u, table.p, metered_filling(table, flow), table.q_m)
    rows = [ca.DM(np.asarray(a)).T for a in columns]
    e_all, J_all = point.map(n)(*rows, ca.repmat(coefficients, 1, n))
    J = ca.reshape(J_all, len(names), n).T
    scatter = ca.Function("map_residual", [coefficients], [e_all.T, J])
    anchor = Anchor(scatter, names, fitted, scatter=scatter)
    if accuracy is not None:
        measured = table.q_m / (flow.sigma if sigma is None else sigma)
        residual = _with_free_scale(scatter, measured, accuracy)
        anchor = Anchor(residual, names, fitted, n_prior=1, scatter=scatter)
    return _with_own_prior(anchor, flow)


def _with_own_prior(anchor: Anchor, flow: Any) -> Anchor:
    """Add what a form knows of its coefficients beside the map, if it states such knowledge."""
    known: dict[str, float] = getattr(flow, "prior_std", {})
    if not known:
        return anchor
    values = flow.parameters.as_dict()
    mean, std = (np.array([of[name] for name in known]) for of in (values, known))
    return join_anchors([anchor, prior(tuple(known), mean, std)])


def _with_free_scale(scatter: ca.Function, measured: FloatArray, accuracy: float) -> ca.Function:
    """Return residuals with the best factor g of the flow meter in them.

    The meter shows q = g q_m(u, p; c) + e with a factor g of 1 ± a. With m and q over σ, the g
    that minimises |g m - q|² + ((g - 1)/a)² is (m q + a⁻²)/(m m + a⁻²). The rows g m - q do not
    change with a common factor of all coefficients; the prior row is (g - 1)/a.
    """
    q, weight = ca.DM(measured), 1 / accuracy**2
    c = ca.MX.sym("c", scatter.size1_in(0))
    e, J = scatter(c)
    m = e + q
    size = ca.dot(m, m) + weight
    g = (ca.dot(m, q) + weight) / size
    slope = ((q - 2 * g * m).T @ J) / size
    rows = [ca.vertcat(g * m - q, (g - 1) / accuracy)]
    slopes = [ca.vertcat(g * J + m @ slope, slope / accuracy)]
    return ca.Function("map_residual_with_free_scale", [c], rows + slopes)


def prior(names: Sequence[str], mean: FloatArray, std: FloatArray) -> Anchor:
    """Return what is known of parameters beforehand, (value - mean) / std for each."""
    c = ca.MX.sym("c", len(names))
    J = np.diag(1 / std)
    residual = ca.Function("prior", [c], [ca.DM(J) @ (c - ca.DM(mean)), ca.MX(ca.DM(J))])
    return Anchor(residual, tuple(names), np.asarray(mean, dtype=float), n_prior=len(names))


def join_anchors(parts: Sequence[Anchor]) -> Anchor:
    """Return the residuals of several sources, measured points first."""
    names = tuple(dict.fromkeys(name for part in parts for name in part.names))
    c = ca.MX.sym("c", len(names))
    rows: list[tuple[Any, Any]] = []
    priors: list[tuple[Any, Any]] = []
    fitted = np.zeros(len(names))
    for part in parts:
        fitted[[names.index(name) for name in part.names]] = part.fitted
        e, wide = _in_all_names(part.residual, part.names, c, names)
        if part.n_points:
            rows.append((e[: part.n_points], wide[: part.n_points, :]))
        if part.n_prior:
            priors.append((e[part.n_points :], wide[part.n_points :, :]))
    stacked = [ca.vertcat(*column) for column in zip(*rows, *priors, strict=True)]
    n_prior = sum(part.n_prior for part in parts)
    residual = ca.Function("anchors", [c], stacked)
    return Anchor(residual, names, fitted, n_prior, _join_scatter(parts, names))


def _join_scatter(parts: Sequence[Anchor], names: Sequence[str]) -> ca.Function | None:
    """Return the residuals of all measured points of several maps; None without any."""
    maps = [(part, part.scatter) for part in parts if part.scatter is not None]
    if not maps:
        return None
    c = ca.MX.sym("c", len(names))
    rows, slopes = [], []
    for part, scatter in maps:
        e, wide = _in_all_names(scatter, part.names, c, names)
        rows.append(e)
        slopes.append(wide)
    return ca.Function("scatter", [c], [ca.vertcat(*rows), ca.vertcat(*slopes)])


def _in_all_names(
    residual: ca.Function, own: Sequence[str], c: ca.MX, names: Sequence[str]
) -> tuple[Any, Any]:
    """Return residuals of the coefficients `own` and their Jacobian to all `names`, given as c."""
    at = [names.index(name) for name in own]
    e, J = residual(c[at])
    wide = ca.MX.zeros(J.shape[0], len(names))
    wide[:, at] = J
    return e, wide


def anchor_flow(
    axis: Axis, flow_map: AnyFlowMap | None, effects: Sequence[Effect] | None = None
) -> Anchor | None:
    """Return what fixes the scale of the flows of an axis; None where nothing does.

    Parameters
    ----------
    axis : Axis
        Its bench says where the flow of the valves comes from.
    flow_map : FlowMap or FlowMapPair, optional
        The measured map, where the valves were metered; two where they differ.
    effects : sequence of Effect, optional
        By default those of the axis.
    """
    bench = axis.bench
    if not isinstance(bench, Bench):
        return None
    chosen = axis.effects if effects is None else effects
    accuracies = meter_accuracies(axis)
    if isinstance(flow_map, FlowMapPair):
        parts = []
        for chamber, table in zip("PN", flow_map, strict=True):
            model, _ = valve_of(axis.flow, chamber)
            own = set(model.parameters.names)
            part = anchor_to_flow_map(
                table, model, effects=chosen, accuracy=accuracies.get(chamber)
            )
            names = tuple(f"{name}_{chamber}" if name in own else name for name in part.names)
            parts.append(replace(part, names=names))
        return join_anchors(parts)
    if flow_map is not None:
        accuracy = accuracies.get("PN")
        return anchor_to_flow_map(flow_map, axis.flow, effects=chosen, accuracy=accuracy)
    if bench.valves.metered:
        return None
    return join_anchors([_area_prior(bench), _valve_prior(axis)])


def _area_prior(bench: Bench) -> Anchor:
    """Return X_s3 = S_P/(r T) and X_s6 = S_N/(r T) to the accuracy of the areas (eq. 10, 11)."""
    mean = np.array([bench.S_P, bench.S_N]) / (bench.r * bench.T)
    return prior(("X_s3", "X_s6"), mean, bench.area_accuracy * mean)


def _valve_prior(axis: Axis) -> Anchor:
    """Return what is known of the coefficients of an unmetered valve."""
    known = axis.flow.parameters
    return prior(known.names, known.values, np.sqrt(np.diag(axis.flow.covariance)))
