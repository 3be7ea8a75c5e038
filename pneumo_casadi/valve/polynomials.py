"""Flow polynomials, affine in the command: eq. 12 of the paper."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.polynomial import Chebyshev, Polynomial
from numpy.typing import ArrayLike

from pneumo_casadi.errors import ModelError
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.runtime.presentation import Brief
from pneumo_casadi.valve.flow_map import FlowMap
from pneumo_casadi.valve.flow_model import KEPT, Symbol, leakage_change, scale_sigma, whole

Degrees = tuple[int, int, int]

BRANCHES = ("phi", "psi_plus", "psi_minus")
"""The three polynomials, in the order of their coefficients in theta."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FlowPolynomials(Brief):
    r"""Mass flow as polynomials in the outlet pressure, affine in the command on either side.

    .. math:: q_m(u, p) = φ(p) + ψ(p, sign u) u \qquad (12)

    φ is the leakage, the same for every command; ψ is the flow gain, ψ⁺ for u > 0 (inlet) and
    ψ⁻ for u < 0 (exhaust). At u = 0 the flow is φ, exactly.

    Parameters
    ----------
    degrees : tuple of int
        Degrees of φ, ψ⁺ and ψ⁻ in p; (7, 7, 4) in the paper; -1 leaves a polynomial out.
    p_range : tuple of float
        Outlet pressures that were metered [Pa].
    u_range : tuple of float
        Commands that were metered [V].
    parameters : Parameters
        Chebyshev coefficients ``phi_k`` [kg/s], ``psi_plus_k`` and ``psi_minus_k`` [kg/(s V)].
    covariance : (n, n) array
        Covariance of the coefficients.
    sigma : float
        Standard deviation of the residuals [kg/s], measurement noise and misfit together.
    dof : int
        Degrees of freedom left in the fit: points minus coefficients.

    Raises
    ------
    ModelError
        If degrees or range of pressures are impossible, or the degrees ask for another number of
        coefficients.

    Notes
    -----
    The pressure is scaled to z in [-1, 1] over `p_range` and the polynomials are written as
    Σ θ_k T_k(z) in Chebyshev polynomials. On a grid of 41 commands by 25 pressures from 1 to
    7 bar the least-squares problem of degrees (7, 7, 4) then has a condition number of 8; in
    powers of the pressure in Pa it is singular in double precision. `monomials` returns the
    coefficients as the paper writes them.

    *Outside the metered pressures* a polynomial of degree seven is worthless within a few
    per cent of the range. It is continued along its tangent at the edge, so that the flow is
    C¹ in p and stays linear in θ: T_k is replaced by T_k(±1) + T_k'(±1) (z ∓ 1) with
    T_k'(±1) = (±1)^(k+1) k². At the upper edge, near the supply pressure, the inlet flow falls
    steeply and its tangent carries the back-flow; at the lower edge, near the exhaust
    pressure, the same holds for u < 0; where the flow is choked the tangent is flat.
    `edge_slopes` gives the slopes; the fit warns of positive ones, which would make the
    chamber unstable out there.
    In u the flow is affine, within and beyond the metered commands. It has a kink at u = 0.

    References
    ----------
    .. [1] "Identification of physical parameters of a pneumatic servosystem", IFAC 2005,
       section 3, eq. 12.
    .. [2] M. Belgharbi et al., "Analytical model of the flow stage of a pneumatic
       servo-distributor for simulation and nonlinear control", 1999.

    Examples
    --------
    >>> from pneumo_casadi.valve import FlowMap, fit_polynomials
    >>> u, p = np.meshgrid(np.linspace(-3, 3, 9), np.linspace(1e5, 7e5, 9))
    >>> q_m = 1e-9 * (4e5 - p) + np.where(u > 0, 2e-3 * (7e5 - p), 1e-3 * (p - 1e5)) * u / 6e5
    >>> flow = fit_polynomials(FlowMap(u.ravel(), p.ravel(), q_m.ravel()), degrees=(1, 1, 1))
    >>> flow.parameters.names
    ('phi_0', 'phi_1', 'psi_plus_0', 'psi_plus_1', 'psi_minus_0', 'psi_minus_1')
    >>> flow([0.0, 1.0], 4e5).round(6)
    array([0.   , 0.001])
    """

    symbol: ClassVar[Symbol] = "SX"

    degrees: Degrees
    p_range: tuple[float, float]
    u_range: tuple[float, float]
    parameters: Parameters
    covariance: FloatArray
    sigma: float
    dof: int

    def __post_init__(self) -> None:
        check_degrees(self.degrees)
        _check_range(self.p_range)
        # By these the law is kept: they must be tuples of numbers.
        object.__setattr__(self, "degrees", tuple(int(degree) for degree in self.degrees))
        object.__setattr__(self, "p_range", tuple(float(p) for p in self.p_range))
        n = sum(self.degrees) + len(self.degrees)
        if len(self.parameters) != n:
            raise ModelError(
                f"degrees {self.degrees} have {n} coefficients, got {len(self.parameters)}"
            )
        covariance = np.array(self.covariance, dtype=float)
        if covariance.shape != (n, n):
            raise ModelError(f"covariance must have shape {(n, n)}, got {covariance.shape}")
        covariance.setflags(write=False)
        object.__setattr__(self, "covariance", covariance)

    def expression(self, u: Any, p: Any, theta: Any) -> Any:
        """Return q_m [kg/s] for CasADi scalars u [V], p [Pa] and the vector theta (n,).

        Works for SX and MX alike.
        """
        return _law(self.degrees, self.p_range)(u, p, whole(theta, len(self.parameters)))

    def expression_at(self, u: Any, p: Any, theta: Any, filling: Any, emptying: Any) -> Any:
        """Return q_m [kg/s] with supply and exhaust at these ratios to the metered pressures.

        Orifice flow is homogeneous of degree one in the pressures on its two sides. ψ⁺ meters
        supply against outlet and goes with the supply, ψ⁻ outlet against exhaust and goes with
        the exhaust; Δφ is `leakage_change`::

            q_m = φ(p) + Δφ(p, s, e) + s ψ⁺(p/s) max(u, 0) + e ψ⁻(p/e) min(u, 0)
        """
        law = _law_at(self.degrees, self.p_range)
        return law(u, p, whole(theta, len(self.parameters)), filling, emptying)

    def design_matrix(self, u: ArrayLike, p: ArrayLike) -> FloatArray:
        """Return D (n, n_coef) with q_m = D θ at points u [V] and p [Pa], both (n,)."""
        return design_matrix_at(u, p, self.degrees, self.p_range)

    def __call__(self, u: ArrayLike, p: ArrayLike) -> FloatArray:
        """Return q_m [kg/s] at the fitted coefficients; u [V] and p [Pa] broadcast."""
        u_all, p_all = np.broadcast_arrays(np.asarray(u, dtype=float), np.asarray(p, dtype=float))
        D = self.design_matrix(u_all.ravel(), p_all.ravel())
        return np.asarray((D @ self.parameters.values).reshape(u_all.shape))

    def residuals(self, table: FlowMap) -> FloatArray:
        """Return measured minus modelled flow [kg/s], shape (n,)."""
        return table.q_m - self(table.u, table.p)

    def with_theta(self, theta: ArrayLike) -> "FlowPolynomials":
        """Return a copy with other coefficients, shape (n_coef,).

        `covariance` and `sigma` are kept: they describe the fit to the map.
        """
        return replace(self, parameters=self.parameters.with_values(theta))

    @property
    def scale_sigma(self) -> float:
        """Relative standard deviation of the overall flow scale, from the noise of the map.

        The scale is the gauge of the identification: multiplying all coefficients and
        X_s1 .. X_s6 by one constant leaves every trajectory unchanged. With C the covariance,
        σ_scale = (θᵀ C⁻¹ θ)^(-1/2). It averages over all points and holds no calibration
        error: that of the flow meter, usually 1 to 2 %, is common to all points and adds to it.
        """
        return scale_sigma(self.parameters.values, self.covariance, self.parameters.scales)

    def monomials(self) -> dict[str, FloatArray]:
        """Return the coefficients of p⁰, p¹, … as the paper would write them.

        Returns
        -------
        dict of str to array
            ``phi`` [kg/s/Paᵏ], ``psi_plus`` and ``psi_minus`` [kg/s/V/Paᵏ], lowest power first;
            empty where a polynomial was left out (degree -1). They hold within `p_range` and
            cancel to many digits: keep them all.
        """
        theta = self.parameters.values

        def powers(coefficients: FloatArray) -> FloatArray:
            if not coefficients.size:
                return coefficients
            series = Chebyshev(coefficients, domain=self.p_range)
            return np.asarray(series.convert(kind=Polynomial).coef)

        return {branch: powers(theta[part]) for branch, part in parts(self.degrees).items()}


@lru_cache(maxsize=KEPT)
def _law(degrees: Degrees, p_range: tuple[float, float]) -> ca.Function:
    """Return ``(u, p, θ) -> q_m``.

    T_k(z) is formed once by recursion and shared by the three polynomials; the branch of ψ is
    picked by max(u, 0) and min(u, 0), which is sign(u) exactly, without smoothing.
    """
    u, p, theta = _symbols(degrees)
    T = _basis(p, p_range, max(degrees), ca.fmax, ca.fmin)
    phi, plus, minus = (_combine(T, theta[part]) for part in parts(degrees).values())
    q_m = phi + plus * ca.fmax(u, 0.0) + minus * ca.fmin(u, 0.0)
    return ca.Function("q_m", [u, p, theta], [q_m])


@lru_cache(maxsize=KEPT)
def _law_at(degrees: Degrees, p_range: tuple[float, float]) -> ca.Function:
    """Return ``(u, p, θ, filling, emptying) -> q_m``."""
    u, p, theta = _symbols(degrees)
    filling, emptying = ca.SX.sym("filling"), ca.SX.sym("emptying")
    phi, plus, minus = (theta[part] for part in parts(degrees).values())

    def continued(coefficients: Any, pressure: Any) -> Any:
        basis = _basis(pressure, p_range, max(degrees), ca.fmax, ca.fmin)
        return _combine(basis, coefficients)

    ends = (continued(phi, p_range[0]), continued(phi, p_range[1]))
    q_m = (
        continued(phi, p)
        + leakage_change(ends, p, p_range, filling, emptying)
        + filling * continued(plus, p / filling) * ca.fmax(u, 0.0)
        + emptying * continued(minus, p / emptying) * ca.fmin(u, 0.0)
    )
    return ca.Function("q_m", [u, p, theta, filling, emptying], [q_m])


def _symbols(degrees: Degrees) -> tuple[ca.SX, ca.SX, ca.SX]:
    return ca.SX.sym("u"), ca.SX.sym("p"), ca.SX.sym("theta", sum(degrees) + len(degrees))


def _basis(p: Any, p_range: tuple[float, float], degree: int, fmax: Any, fmin: Any) -> list[Any]:
    """T_0 .. T_degree of the scaled pressure, each continued along its tangent at the edges."""
    _check_range(p_range)
    low, high = p_range
    z = (p - (low + high) / 2) * (2 / (high - low))
    inner = fmin(fmax(z, -1.0), 1.0)
    outer = z - inner  # positive above the range, negative below, zero within
    T: list[Any] = [1.0, inner]
    for _ in range(2, degree + 1):
        T.append(2 * inner * T[-1] - T[-2])
    # T_k'(±1) = (±1)^(k+1) k²: of one sign for odd k, of both for even k.
    tangent = {1: outer, 0: fmax(outer, -outer)}
    return [T[0], *(T[k] + k * k * tangent[k % 2] for k in range(1, degree + 1))]


def _combine(basis: list[Any], coefficients: Any) -> Any:
    if coefficients.shape[0] == 0:  # degree -1: this polynomial is left out
        return 0.0
    total = coefficients[0]
    for k in range(1, coefficients.shape[0]):
        total = total + coefficients[k] * basis[k]
    return total


def parts(degrees: Degrees) -> dict[str, slice]:
    """Return where each polynomial has its coefficients in theta."""
    ends = np.cumsum([degree + 1 for degree in degrees])
    return {
        branch: slice(int(end) - degree - 1, int(end))
        for branch, end, degree in zip(BRANCHES, ends, degrees, strict=True)
    }


def design_matrix_at(
    u: ArrayLike, p: ArrayLike, degrees: Degrees, p_range: tuple[float, float]
) -> FloatArray:
    """Return D (n, n_coef) with q_m = D θ for given degrees and pressure range [Pa]."""
    u_all = np.asarray(u, dtype=float)
    p_all = np.asarray(p, dtype=float)
    if u_all.ndim != 1 or u_all.shape != p_all.shape:
        raise ModelError(f"u and p must be (n,) arrays, got shapes {u_all.shape}, {p_all.shape}")
    T = _basis(p_all, p_range, max(degrees), np.maximum, np.minimum)
    T[0] = np.ones_like(p_all)
    factors = (np.ones_like(u_all), np.maximum(u_all, 0.0), np.minimum(u_all, 0.0))
    return np.column_stack(
        [
            factor * T[k]
            for factor, degree in zip(factors, degrees, strict=True)
            for k in range(degree + 1)
        ]
    )


def _check_range(p_range: tuple[float, float]) -> None:
    if not p_range[1] > p_range[0]:
        raise ModelError(f"p_range {p_range} Pa is empty; meter at two outlet pressures or more")


def check_degrees(degrees: Degrees) -> None:
    """Raise a `ModelError` unless `degrees` are three whole numbers from -1 to 20."""
    whole = np.ndim(degrees) == 1 and all(d in range(-1, 21) for d in degrees)
    if not whole or len(degrees) != 3:
        raise ModelError(
            f"degrees {degrees}: expected three whole numbers from 0 to 20 (-1 leaves one out), "
            "of φ, ψ(u > 0) and ψ(u < 0)"
        )
