"""Flow map as a smoothing tensor-product spline with a kink at u = 0."""

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg
from scipy.interpolate import BSpline

from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray, Parameter, Parameters
from pneumo_casadi.runtime.presentation import Brief
from pneumo_casadi.valve.flow_map import FlowMap
from pneumo_casadi.valve.flow_model import (
    Symbol,
    evaluate,
    flow_function,
    leakage_change,
    warn_of_rising_edges,
)

REACH = 100.0
"""Width of the linear continuation on either side, in ranges of the map."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FlowSpline(Brief):
    """Mass flow as a tensor-product B-spline times one gain.

    Parameters
    ----------
    knots_u, knots_p : (k,) array
        Knots in command [V] and outlet pressure [Pa], linear continuation included.
    degree_u, degree_p : int
        Degrees of the spline.
    coefficients : (n_u, n_p) array
        B-spline coefficients [kg/s].
    p_range, u_range : tuple of float
        Outlet pressures [Pa] and commands [V] that were metered.
    parameters : Parameters
        ``flow_gain`` [1], 1 as fitted: the gauge of the identification.
    covariance : (1, 1) array
        Variance of the gain at the fitted shape, from the scatter of the map.
    sigma : float
        Standard deviation of the residuals [kg/s].
    dof : float
        Points minus effective number of coefficients (trace of the smoother).

    Notes
    -----
    The spline is C² within either side of u = 0 and merely continuous across it: the knot
    u = 0 is repeated, as inlet and exhaust edge are different restrictions. Outside the
    metered range it goes on along its tangent, exactly: the last segments of the spline are
    straight and a hundred ranges long. `expression` is MX, as CasADi's B-splines are; a spline
    of this size written out in SX would evaluate all its pieces at every call.
    """

    symbol: ClassVar[Symbol] = "MX"

    knots_u: FloatArray
    knots_p: FloatArray
    degree_u: int
    degree_p: int
    coefficients: FloatArray
    p_range: tuple[float, float]
    u_range: tuple[float, float]
    parameters: Parameters
    covariance: FloatArray
    sigma: float
    dof: float
    _function: ca.Function = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("knots_u", "knots_p", "coefficients", "covariance"):
            values = np.array(getattr(self, name), dtype=float)
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        object.__setattr__(self, "_function", flow_function(self))

    def expression(self, u: Any, p: Any, theta: Any) -> Any:
        """Return q_m [kg/s] for MX scalars u [V], p [Pa] and theta (1,), the gain."""
        return theta[0] * self._shape(u, p)

    def expression_at(self, u: Any, p: Any, theta: Any, filling: Any, emptying: Any) -> Any:
        """Return q_m [kg/s] with supply and exhaust at these ratios to the metered pressures.

        As for the polynomials: what an opening adds to the closed valve's flow is similar in
        the pressure of its port; the closed valve's flow has both (`leakage_change`).
        """
        p_s, p_e = p / filling, p / emptying
        inlet = self._shape(ca.fmax(u, 0.0), p_s) - self._shape(0.0, p_s)
        exhaust = self._shape(ca.fmin(u, 0.0), p_e) - self._shape(0.0, p_e)
        ends = (self._shape(0.0, self.p_range[0]), self._shape(0.0, self.p_range[1]))
        closed = self._shape(0.0, p) + leakage_change(ends, p, self.p_range, filling, emptying)
        return theta[0] * (closed + filling * inlet + emptying * exhaust)

    def _shape(self, u: Any, p: Any) -> Any:
        return ca.bspline(
            ca.vertcat(u, p),
            ca.DM(self.coefficients.ravel(order="F")),
            [self.knots_u.tolist(), self.knots_p.tolist()],
            [self.degree_u, self.degree_p],
            1,
            {},
        )

    def __call__(self, u: ArrayLike, p: ArrayLike) -> FloatArray:
        """Return q_m [kg/s] at the fitted gain; u [V] and p [Pa] broadcast."""
        return evaluate(self._function, u, p, self.parameters.values)

    def residuals(self, table: FlowMap) -> FloatArray:
        """Return measured minus modelled flow [kg/s], shape (n,)."""
        return table.q_m - self(table.u, table.p)

    def with_theta(self, theta: ArrayLike) -> "FlowSpline":
        """Return a copy with another gain, shape (1,)."""
        return replace(self, parameters=self.parameters.with_values(theta))

    @property
    def scale_sigma(self) -> float:
        """Relative standard deviation of the flow scale from the noise of the map."""
        return float(np.sqrt(self.covariance[0, 0]))


def fit_spline(
    table: FlowMap, *, segments_u: int = 2, segments_p: int = 24, smoothing: float | None = None
) -> FlowSpline:
    """Fit a penalised tensor-product spline to a measured map.

    Parameters
    ----------
    table : FlowMap
        Measured points, on a grid or scattered, all at one supply pressure.
    segments_u : int, optional
        Segments on either side of u = 0; fewer where there are too few commands.
    segments_p : int, optional
        Segments in pressure; at most three less than there are pressure columns, so that there
        are no more coefficients than columns.
    smoothing : float, optional
        Weight λ of the penalty on the second derivatives in scaled variables; by default the
        one with the least generalised cross-validation score, n RSS / (n − tr H)².

    Raises
    ------
    CaseError
        If fewer than four pressure columns were metered.
    """
    flow, _ = smooth_map(table, segments_u, segments_p, smoothing)
    warn_of_rising_edges(flow, table)
    return flow


def smooth_map(
    table: FlowMap, segments_u: int = 2, segments_p: int = 24, smoothing: float | None = None
) -> tuple[FlowSpline, float]:
    """Return what `fit_spline` fits, without its warning, and the smoothing λ that was taken."""
    table.require_one_supply()
    pressures = _column_pressures(table)
    if pressures.size < 4:
        raise CaseError(
            f"{table.source}: {pressures.size} distinct pressures; a spline needs at least 4"
        )
    degree_p = 3
    # With more coefficients than columns, the scatter of the pressures within the columns would
    # settle those that are left.
    knots_p = _clamped(pressures, min(segments_p, pressures.size - degree_p), degree_p)
    knots_u, degree_u = _knots_with_kink(np.unique(table.u), segments_u)
    shape = (len(knots_u) - degree_u - 1, len(knots_p) - degree_p - 1)
    B = _tensor(_basis(table.u, knots_u, degree_u, 0), _basis(table.p, knots_p, degree_p, 0))
    penalty = _roughness(knots_u, degree_u, knots_p, degree_p)
    coefficients, effective, smoothing = _smooth(B, table.q_m, penalty, smoothing)
    fitted = B @ coefficients
    dof = table.n - effective
    sigma = float(np.sqrt(np.sum((table.q_m - fitted) ** 2) / dof))
    C = coefficients.reshape(shape)
    knots_u, C = _extended(knots_u, C, degree_u)
    knots_p, C_transposed = _extended(knots_p, C.T, degree_p)
    gain = Parameter(
        "flow_gain", 1.0, "1", lower=0.0, scale=0.1, description="gain of the whole flow map"
    )
    flow = FlowSpline(
        knots_u,
        knots_p,
        degree_u,
        degree_p,
        C_transposed.T,
        table.p_range,
        table.u_range,
        Parameters([gain]),
        np.array([[sigma**2 / float(fitted @ fitted)]]),
        sigma,
        dof,
    )
    return flow, smoothing


def _column_pressures(table: FlowMap) -> FloatArray:
    """Return the pressures of the columns [Pa], with the outermost points as the ends."""
    column = table.column_numbers
    pressures = np.array([np.median(table.p[column == i]) for i in range(column.max() + 1)])
    pressures[0], pressures[-1] = table.p_range
    return pressures


def _clamped(sites: FloatArray, segments: int, degree: int) -> FloatArray:
    breaks = np.quantile(sites, np.linspace(0.0, 1.0, segments + 1))
    return np.concatenate([[breaks[0]] * degree, breaks, [breaks[-1]] * degree])


def _knots_with_kink(commands: FloatArray, segments: int) -> tuple[FloatArray, int]:
    """Knots in u, that at zero repeated so that the spline is only continuous there."""
    if commands.size == 1:  # one opening: constant in u
        return np.array([commands[0] - 0.5, commands[0] + 0.5]), 0
    if not commands[0] < 0 < commands[-1]:
        degree = min(3, commands.size - 1)
        return _clamped(commands, min(segments, commands.size - degree), degree), degree
    sides = [np.r_[commands[commands < 0], 0.0], np.r_[0.0, commands[commands > 0]]]
    degree = min(3, *(side.size - 1 for side in sides))
    left, right = (_clamped(side, min(segments, side.size - degree), degree) for side in sides)
    return np.r_[left[:-1], right[degree + 1 :]], degree


def _basis(sites: FloatArray, knots: FloatArray, degree: int, derivative: int) -> FloatArray:
    n = len(knots) - degree - 1
    values = BSpline(knots, np.eye(n), degree)(sites, nu=derivative)
    return np.asarray(values, dtype=float)


def _tensor(B_u: FloatArray, B_p: FloatArray) -> FloatArray:
    return np.asarray((B_u[:, :, None] * B_p[:, None, :]).reshape(len(B_u), -1))


def _roughness(
    knots_u: FloatArray, degree_u: int, knots_p: FloatArray, degree_p: int
) -> FloatArray:
    """Mean square of second derivatives over the map, in variables scaled to unit range."""
    gram = []
    for knots, degree in ((knots_u, degree_u), (knots_p, degree_p)):
        breaks = np.unique(knots)
        nodes, weights = np.polynomial.legendre.leggauss(4)
        half = np.diff(breaks) / 2
        sites = ((breaks[:-1] + breaks[1:])[:, None] / 2 + half[:, None] * nodes).ravel()
        width = breaks[-1] - breaks[0]
        w = (half[:, None] * weights).ravel() / width
        by_derivative = []
        for derivative in (0, 2):
            B = _basis(sites, knots, degree, derivative) * width**derivative
            by_derivative.append(B.T @ (w[:, None] * B))
        gram.append(by_derivative)
    (mass_u, rough_u), (mass_p, rough_p) = gram
    return np.asarray(np.kron(rough_u, mass_p) + np.kron(mass_u, rough_p))


def _smooth(
    B: FloatArray, q: FloatArray, penalty: FloatArray, smoothing: float | None
) -> tuple[FloatArray, float, float]:
    """Coefficients, their effective number, and the smoothing, chosen by GCV unless given."""
    n = len(q)
    A, rhs = B.T @ B / n, B.T @ q / n
    G = A + 1e-14 * np.trace(A) / len(A) * np.eye(len(A))  # settles what no point reaches
    if smoothing is None:
        smoothing = _least_score(G, B, q, penalty, np.geomspace(1e-12, 1.0, 37))
    solved = np.linalg.solve(G + smoothing * penalty, np.column_stack([rhs, A]))
    return solved[:, 0], float(np.trace(solved[:, 1:])), smoothing


def _least_score(
    G: FloatArray, B: FloatArray, q: FloatArray, penalty: FloatArray, weights: FloatArray
) -> float:
    """Return the weight of the penalty with the least generalised cross-validation score.

    All weights share the eigenvectors of the penalty in the metric of the normal matrix with a
    middle weight: one decomposition instead of a solution for each.

    Parameters
    ----------
    G : (m, m) array
        Normal matrix BᵀB / n, with what settles coefficients that no point reaches.
    B : (n, m) array
        Basis at the points.
    q : (n,) array
        Flows [kg/s].
    penalty : (m, m) array
        Roughness of the coefficients.
    weights : (k,) array
        Candidates.

    Raises
    ------
    CaseError
        If there are not more points than coefficients in effect, whatever the weight.
    """
    n = len(q)
    middle = float(np.sqrt(weights[0] * weights[-1]))
    rough, V = linalg.eigh(penalty, G + middle * penalty)
    fitted = B @ V
    share, projected = np.sum(fitted**2, axis=0) / n, fitted.T @ q / n
    scores = {}
    for weight in weights:
        shrunk = 1.0 / (1.0 + (weight - middle) * rough)
        left = n - float(share @ shrunk)
        if left >= 1:
            scores[float(weight)] = (
                float(np.sum((q - fitted @ (shrunk * projected)) ** 2)) / left**2
            )
    if not scores:
        raise CaseError(
            f"{n} points leave no residual to judge the spline by; use fewer segments or more "
            "smoothing"
        )
    return min(scores, key=scores.__getitem__)


def _extended(knots: FloatArray, C: FloatArray, degree: int) -> tuple[FloatArray, FloatArray]:
    """Add a straight segment at either end of a clamped spline along the first axis of `C`.

    The blossom of a straight line ℓ at (t_1 .. t_d) is ℓ at their mean, which gives the
    coefficients of the new segments; the end knot keeps multiplicity degree − 1, hence C¹.
    """
    if degree == 0:
        far = (knots[-1] - knots[0]) * 1e6
        return np.r_[knots[0] - far, knots[1:-1], knots[-1] + far], C
    for _ in range(2):  # the lower end, then the mirrored upper end
        a, t = knots[0], knots[degree + 1]
        far = a - REACH * (np.max(knots) - np.min(knots)) * np.sign(t - a)
        slope = (C[1] - C[0]) * degree / (t - a)
        sites = (np.arange(degree, 0, -1) * far + np.arange(degree) * a) / degree
        C = np.concatenate([C[0] + np.multiply.outer(sites - a, slope), C[1:]])[::-1]
        knots = np.r_[[far] * (degree + 1), [a] * (degree - 1), knots[degree + 1 :]][::-1]
    return np.array(knots), np.array(C)
