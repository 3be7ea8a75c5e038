"""Least-squares fit of the flow polynomials (eq. 12) to a measured map."""

import numpy as np
from numpy.typing import ArrayLike

from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray, Parameter, Parameters
from pneumo_casadi.valve.flow_map import FlowMap
from pneumo_casadi.valve.flow_model import warn_of_rising_edges
from pneumo_casadi.valve.polynomials import (
    BRANCHES,
    Degrees,
    FlowPolynomials,
    check_degrees,
    design_matrix_at,
)


def fit_polynomials(
    table: FlowMap, degrees: Degrees = (7, 7, 4), weights: ArrayLike | None = None
) -> FlowPolynomials:
    """Fit the flow polynomials of eq. 12 to a measured map by linear least squares.

    Parameters
    ----------
    table : FlowMap
        Measured points, on a grid or scattered, all at one supply pressure.
    degrees : tuple of int, optional
        Degrees of φ, ψ(u > 0) and ψ(u < 0); -1 leaves a polynomial out, as for a curve
        metered at one opening: (7, -1, -1).
    weights : (n,) array, optional
        Weights of the *squared* residuals, 1/σ² of each point up to a common factor; they
        are divided by their mean, so that `sigma` belongs to a point of average weight.

    Returns
    -------
    FlowPolynomials
        With covariance σ² (DᵀWD)⁻¹, σ² from the residuals.

    Raises
    ------
    CaseError
        If the points do not determine the coefficients, or supply pressures are mixed.
    """
    flow = solve_polynomials(table, degrees, weights)
    warn_of_rising_edges(flow, table)
    return flow


def solve_polynomials(
    table: FlowMap, degrees: Degrees, weights: ArrayLike | None = None
) -> FlowPolynomials:
    """Return what `fit_polynomials` fits, without its warning."""
    check_degrees(degrees)
    table.require_one_supply()
    w = _normalised_weights(weights, table)
    _check_determined(table, degrees)
    D = design_matrix_at(table.u, table.p, degrees, table.p_range)
    q_rms = float(np.sqrt(np.mean(table.q_m**2)))
    u_rms = float(np.sqrt(np.mean(table.u**2))) or 1.0
    size = np.array(
        [
            q_rms if branch == "phi" else q_rms / u_rms
            for branch, degree in zip(BRANCHES, degrees, strict=True)
            for _ in range(degree + 1)
        ]
    )
    root = np.sqrt(w)
    solution, covariance_root = _solve(root[:, None] * D * (size / q_rms), root * table.q_m / q_rms)
    if solution is None:
        raise CaseError(
            f"{table.source}: the points do not determine all {D.shape[1]} coefficients of degrees "
            f"{degrees}; spread the pressures or lower the degrees"
        )
    theta = solution * size
    covariance_root = covariance_root * (size / q_rms)[:, None]
    residuals = root * (table.q_m - D @ theta)
    dof = table.n - len(theta)
    sigma = float(np.sqrt(residuals @ residuals / dof))
    return FlowPolynomials(
        degrees=(degrees[0], degrees[1], degrees[2]),
        p_range=table.p_range,
        u_range=table.u_range,
        parameters=_parameters(theta, size, degrees),
        covariance=sigma**2 * covariance_root @ covariance_root.T,
        sigma=sigma,
        dof=dof,
    )


def _solve(A: FloatArray, y: FloatArray) -> tuple[FloatArray | None, FloatArray]:
    """Least-squares solution and a root of (AᵀA)⁻¹; None where A is rank deficient."""
    Q, R = np.linalg.qr(A)
    if np.linalg.cond(R) > 1e10:
        return None, R
    return np.linalg.solve(R, Q.T @ y), np.linalg.inv(R)


def _parameters(theta: FloatArray, size: FloatArray, degrees: Degrees) -> Parameters:
    names = [(branch, k) for branch, d in zip(BRANCHES, degrees, strict=True) for k in range(d + 1)]
    return Parameters(
        Parameter(
            f"{branch}_{k}",
            value,
            "kg/s" if branch == "phi" else "kg/(s V)",
            scale=scale,
            description=f"Chebyshev coefficient {k} of the {_MEANING[branch]}",
            source="eq. 12",
        )
        for (branch, k), value, scale in zip(names, theta, size, strict=True)
    )


_MEANING = {
    "phi": "leakage flow",
    "psi_plus": "flow gain for u > 0",
    "psi_minus": "flow gain for u < 0",
}


def _check_determined(table: FlowMap, degrees: Degrees) -> None:
    columns = table.column_numbers
    sides = {"phi": table.u == table.u, "psi_plus": table.u > 0, "psi_minus": table.u < 0}
    for (branch, points), degree in zip(sides.items(), degrees, strict=True):
        distinct = np.unique(columns[points]).size
        if distinct <= degree:
            raise CaseError(
                f"{table.source}: {branch} of degree {degree} needs {degree + 1} distinct "
                f"pressures{_SIDE[branch]}, the map has {distinct}; meter more or lower the degree"
            )
    n = sum(degrees) + 3
    if table.n <= n:
        raise CaseError(
            f"{table.source}: {table.n} points for {n} coefficients leave no residual to judge "
            "the fit by; meter more points or lower the degrees"
        )


_SIDE = {"phi": "", "psi_plus": " at u > 0", "psi_minus": " at u < 0"}


def _normalised_weights(weights: ArrayLike | None, table: FlowMap) -> FloatArray:
    if weights is None:
        return np.ones(table.n)
    w = np.array(weights, dtype=float)
    if w.shape != (table.n,) or not np.all(np.isfinite(w)) or np.any(w <= 0):
        raise CaseError(
            f"{table.source}: weights must be {table.n} positive numbers, one per point; "
            "leave a point out with `table.select`"
        )
    return np.asarray(w / w.mean())
