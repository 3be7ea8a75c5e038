"""Flow map shape: what polynomials affine in the command cannot bend to."""

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pneumo_casadi.effect import Effect, Expression, Pair, Scope
from pneumo_casadi.errors import ModelError
from pneumo_casadi.flow import FlowMap, FlowModel
from pneumo_casadi.parameters import Parameter


class FlowMapShape(Effect):
    """Edges that open more, or less, than in proportion to the command.

    The opening is u + c⁺ u² for u > 0 and u − c⁻ u² for u < 0: the first term that eq. 12, affine
    in u on either side, leaves out. Where the static map was measured,
    `measured_flow_map_shape` takes the whole shape from it.
    """

    name = "flow_map_shape"
    equation = "u −→ u + c⁺ max(u, 0)² − c⁻ min(u, 0)²"
    source = "residuals of eq. 12 at the measured static map"
    shows = "both mass flow balances at large or small openings; residuals of the static map"
    confused_with = ("flow coefficients", "supply_droop", "exhaust_restriction", "valve_dead_zone")
    separated_by = "meter the valve at more commands; amplitudes from small to full opening"
    parameters = tuple(
        Parameter(
            f"c_{side}",
            0.0,
            "1/V",
            lower=-0.05,
            upper=1.0,
            scale=0.02,
            null=0.0,
            start=0.03,
            description=f"bend of the {edge} edge",
            source="port windows, rectangular to round: up to 10 % of the flow at half opening",
        )
        for side, edge in (("plus", "supply"), ("minus", "exhaust"))
    )

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Bend the opening."""
        return Pair(*(_bent(one, at) for one in u))


def _bent(u: Expression, at: Scope) -> Expression:
    return u + at["c_plus"] * ca.fmax(u, 0.0) ** 2 - at["c_minus"] * ca.fmin(u, 0.0) ** 2


class MeasuredFlowMapShape(Effect):
    """The opening that the measured map asks for where a flow model cannot bend to it.

    u −→ u + a h(u, p), with h a polynomial in the command on either side of zero, vanishing at
    zero, times one in the outlet pressure. Use `measured_flow_map_shape` to make one.

    Parameters
    ----------
    coefficients : (2, n_u, n_p) array
        Of Σ c_sjk (u/u_s)^(j+1) T_k(z) on the inlet and the exhaust side [V].
    reach : tuple of float
        Greatest metered command on either side, positive [V].
    p_range : tuple of float
        Metered outlet pressures [Pa].
    """

    name = "measured_flow_map_shape"
    equation = "u −→ u + a h(u, p), h from the residuals of the measured map"
    source = FlowMapShape.source
    shows = FlowMapShape.shows
    confused_with = FlowMapShape.confused_with
    separated_by = FlowMapShape.separated_by
    parameters = (
        Parameter(
            "amplitude",
            0.0,
            "1",
            lower=-0.5,
            upper=2.0,
            scale=0.5,
            null=0.0,
            start=1.0,
            description="share of the measured shape that the valve shows in operation",
            source="1 where the valve in operation is the valve that was metered",
        ),
    )

    def __init__(
        self, coefficients: ArrayLike, reach: tuple[float, float], p_range: tuple[float, float]
    ) -> None:
        self.coefficients = np.array(coefficients, dtype=float)
        self.reach = reach
        self.p_range = p_range

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Correct the opening."""
        return Pair(
            u.P + at["amplitude"] * self.correction(u.P, at.p.P),
            u.N + at["amplitude"] * self.correction(u.N, at.p.N),
        )

    def correction(self, u: Expression, p: Expression) -> Expression:
        """Return h(u, p) [V], CasADi or numpy."""
        _, n_u, n_p = self.coefficients.shape
        basis = _shape_basis(u, p, self.reach, self.p_range, n_u, n_p)
        return sum(c * b for c, b in zip(self.coefficients.ravel(), basis, strict=True))


def measured_flow_map_shape(
    table: FlowMap, flow: FlowModel, n_u: int = 3, n_p: int = 4
) -> MeasuredFlowMapShape:
    """Return the shape that a measured map has beyond a flow model, as an effect.

    Parameters
    ----------
    table : FlowMap
        Measured flows.
    flow : FlowModel
        What was fitted to them: eq. 12, say.
    n_u, n_p : int, optional
        Terms in the command on either side, and in the outlet pressure.

    Returns
    -------
    MeasuredFlowMapShape
        Of amplitude 0; a fit starts at 1. The residuals q_m − q(u, p) are met by
        ∂q/∂u · h(u, p) in the sense of least squares, so that an edge across which no pressure
        drives a flow asks for nothing.

    Raises
    ------
    ModelError
        If one side of the valve was not metered.
    """
    reach = (float(table.u.max()), float(-table.u.min()))
    if min(reach) <= 0:
        raise ModelError(
            f"{table.source}: commands from {table.u.min():g} to {table.u.max():g} V; meter both "
            "sides of the valve to see the shape of both edges"
        )
    low, high = table.p_range
    step = 1e-3 * np.where(table.u >= 0, reach[0], -reach[1])  # away from the kink at zero
    gain = (flow(table.u + step, table.p) - flow(table.u, table.p)) / step
    basis = _shape_basis(table.u, table.p, reach, (low, high), n_u, n_p)
    design = gain[:, None] * np.column_stack([np.asarray(b, dtype=float) for b in basis])
    size = np.linalg.norm(design, axis=0)
    size[size == 0] = 1.0
    found, *_ = np.linalg.lstsq(design / size, flow.residuals(table), rcond=1e-6)
    return MeasuredFlowMapShape((found / size).reshape(2, n_u, n_p), reach, (low, high))


def _shape_basis(
    u: Any, p: Any, reach: tuple[float, float], p_range: tuple[float, float], n_u: int, n_p: int
) -> list[Any]:
    """Return (u/u_s)^(j+1) T_k(z) on the side of u, in the order (side, j, k)."""
    low, high = p_range
    inside = ca.fmin(ca.fmax((2 * p - low - high) / (high - low), -1.0), 1.0)
    T = [1.0 + 0 * inside, inside]
    for _ in range(2, n_p):
        T.append(2 * inside * T[-1] - T[-2])
    sides = (ca.fmax(u / reach[0], 0.0), ca.fmax(-u / reach[1], 0.0))
    return [s ** (j + 1) * T[k] for s in sides for j in range(n_u) for k in range(n_p)]
