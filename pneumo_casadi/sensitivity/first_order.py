r"""To first order, how estimates answer to a change of the flow map: no fit is made again.

Output error with free coefficients c has the Gauss-Newton information H over (θ, c) and the
covariance C = H⁻¹. Three answers follow from C alone.

- Map held at c: ∂θ̂/∂c = −H_θθ⁻¹ H_θc = C_θc C_cc⁻¹. What the map adds to H_cc drops out, and so
  do the initial states, which were eliminated from H.
- Map fitted by itself: ∂c/∂q = (DᵀD)⁻¹ Dᵀ with D = ∂q_m/∂c at the metered points.
- Map anchored: ∂θ̂/∂q = C_θc Dᵀ/σ², as a metered point enters with weight 1/σ². Where the accuracy a
  of the flow meter is stated, the residuals are g q_m − q with the best factor g of 1 ± a, which
  takes up what all points have in common: D becomes g (D − m mᵀD/(mᵀm + σ²/a²)) with m = q_m.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.flow_scale import meter_accuracies
from pneumo_casadi.estimation.output_error import OutputErrorResult
from pneumo_casadi.estimation.static_flow import metered_filling, metered_flow
from pneumo_casadi.estimation.wls.fit import POLYTROPIC
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.sensitivity.variants import Treatment
from pneumo_casadi.valve import FlowMap, FlowModel


@dataclass(frozen=True, slots=True, eq=False)
class MapSensitivity:
    """Derivatives of the estimates with respect to the flow map.

    Parameters
    ----------
    names : tuple of str
        Free parameters other than the map's, then k_P and k_N.
    coefficients : tuple of str
        Coefficients of the map that were free and inside their bounds.
    fixed : (n, n_c) array
        ∂θ̂/∂c of a fit that holds the map.
    fixed_to_flow, anchored_to_flow : (n, n_points) array
        ∂θ̂/∂q_m by metered point [per kg/s], with the map held as fitted, and anchored.
    """

    names: tuple[str, ...]
    coefficients: tuple[str, ...]
    fixed: FloatArray
    fixed_to_flow: FloatArray
    anchored_to_flow: FloatArray

    def shift(self, flow_error: ArrayLike, treatment: Treatment) -> dict[str, float]:
        """Return by how much each estimate moves for errors of the metered flows [kg/s].

        Raises
        ------
        ModelError
            If there is not one error for each metered point.
        """
        slope = self._to_flow(treatment)
        error = np.asarray(flow_error, dtype=float)
        if error.shape != slope.shape[1:]:
            raise ModelError(f"{error.shape} flow errors for {slope.shape[1]} metered points")
        return dict(zip(self.names, (slope @ error).tolist(), strict=True))

    def shift_of_coefficients(self, change: Mapping[str, float]) -> dict[str, float]:
        """Return by how much each estimate moves for a change of a held map's coefficients."""
        unknown = set(change) - set(self.coefficients)
        if unknown:
            raise ModelError(f"no free coefficient {', '.join(sorted(unknown))} in the map")
        error = np.array([change.get(name, 0.0) for name in self.coefficients])
        return dict(zip(self.names, (self.fixed @ error).tolist(), strict=True))

    def std(self, noise: float, treatment: Treatment) -> dict[str, float]:
        """Return the spread of each estimate from white noise of the map [kg/s]."""
        spread = noise * np.linalg.norm(self._to_flow(treatment), axis=1)
        return dict(zip(self.names, spread.tolist(), strict=True))

    def _to_flow(self, treatment: Treatment) -> FloatArray:
        if treatment is Treatment.LEFT_OUT:
            raise ModelError("a map that is left out moves no estimate")
        return self.fixed_to_flow if treatment is Treatment.FIXED else self.anchored_to_flow


def map_sensitivity(result: OutputErrorResult, flow_map: FlowMap) -> MapSensitivity:
    """Return the first-order answer of the estimates to the flow map.

    Parameters
    ----------
    result : OutputErrorResult
        A fit with the coefficients of the map free and anchored to `flow_map`.
    flow_map : FlowMap
        The map it was anchored to.

    Returns
    -------
    MapSensitivity

    Raises
    ------
    ModelError
        If the map's coefficients were not free, or nothing is known of a parameter.
    CaseError
        If supply pressures are mixed and the form holds at one.
    """
    flow: FlowModel = result.axis.flow
    estimate = result.uncertainty
    finite = np.isfinite(np.diag(estimate.covariance))
    own = set(flow.parameters.names)
    c = [i for i, n in enumerate(estimate.names) if n in own and finite[i]]
    theta = [i for i, n in enumerate(estimate.names) if n not in own]
    lost = [estimate.names[i] for i in theta if not finite[i]]
    if not c or lost:
        what = f"nothing is known of {', '.join(lost)}" if lost else "no coefficient was free"
        raise ModelError(f"{what}: fit with the map anchored, all its points given")
    coefficients = tuple(estimate.names[i] for i in c)
    D = _slopes(flow, flow_map, flow.parameters.values, coefficients)
    values = result.parameters.select(flow.parameters.names).values
    D_anchored = _slopes(flow, flow_map, values, coefficients)
    C = estimate.covariance
    # Coefficients of a polynomial and of a spool differ in size by orders of magnitude.
    size = np.sqrt(np.diag(C)[c])
    regression = np.linalg.solve(
        C[np.ix_(c, c)] / np.outer(size, size), C[np.ix_(c, theta)] / size[:, None]
    )
    fixed = regression.T / size
    norm = np.linalg.norm(D, axis=0)
    by_flow = np.linalg.pinv(D / norm) / norm[:, None]
    D_anchored = _with_free_scale(D_anchored, flow_map, result, values)
    anchored = C[np.ix_(theta, c)] @ D_anchored.T / flow.sigma**2
    names = tuple(estimate.names[i] for i in theta)
    add = _ratio_rows(result, names)
    return MapSensitivity(
        (*names, *POLYTROPIC),
        coefficients,
        add @ fixed,
        add @ fixed @ by_flow,
        add @ anchored,
    )


def _with_free_scale(
    D: FloatArray, table: FlowMap, result: OutputErrorResult, theta: FloatArray
) -> FloatArray:
    """Return how residuals answer to coefficients where the factor of the flow meter is free."""
    accuracy = meter_accuracies(result.axis).get("PN")
    if accuracy is None:
        return D
    flow = result.axis.flow
    q, _ = metered_flow(flow, ())
    m = np.asarray(q.map(table.n)(*_points(table, flow), ca.DM(theta)), dtype=float).ravel()
    weight = (result.axis.flow.sigma / accuracy) ** 2
    size = m @ m + weight
    g = (m @ table.q_m + weight) / size
    return np.asarray(g * (D - np.outer(m, m @ D) / size))


def _slopes(
    flow: FlowModel, table: FlowMap, theta: FloatArray, names: tuple[str, ...]
) -> FloatArray:
    """Return ∂q_m/∂c at the metered points, shape (n_points, n_c)."""
    q, _ = metered_flow(flow, ())
    symbol = ca.MX.sym("c", theta.size)
    row = q.map(table.n)(*_points(table, flow), ca.repmat(symbol, 1, table.n))
    jacobian = ca.Function("slopes", [symbol], [ca.jacobian(row.T, symbol)])
    at = [flow.parameters.index(name) for name in names]
    return np.asarray(ca.DM(jacobian(theta)).full())[:, at]


def _points(table: FlowMap, flow: FlowModel) -> list[ca.DM]:
    """Return command, outlet pressure and relative supply pressure of the points, (1, n) each."""
    return [ca.DM(a).T for a in (table.u, table.p, metered_filling(table, flow))]


def _ratio_rows(result: OutputErrorResult, names: tuple[str, ...]) -> FloatArray:
    """Return the identity with the gradients of k_P and k_N below it."""
    rows = [np.eye(len(names))]
    for top, bottom in POLYTROPIC.values():
        row = np.zeros((1, len(names)))
        a, b = result.parameters[top].value, result.parameters[bottom].value
        row[0, names.index(top)] = 1 / b
        row[0, names.index(bottom)] = -a / b**2
        rows.append(row)
    return np.concatenate(rows)
