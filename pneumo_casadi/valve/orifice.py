"""One pneumatic restriction after ISO 6358: sonic conductance C, critical ratio b, index m."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from pneumo_casadi.errors import CaseError, FitError
from pneumo_casadi.parameters import FloatArray, Parameter, Parameters
from pneumo_casadi.valve.flow_map import P_PLAUSIBLE

Evaluation = Callable[[FloatArray], tuple[FloatArray, FloatArray]]

RHO_ANR = 1.185
"""Density of the standard reference atmosphere (ANR, ISO 8778), 20 °C, 1 bar, 65 % [kg/m³]."""
T_ANR = 293.15
"""Temperature of the standard reference atmosphere (ANR) [K]."""
LAMINAR_RATIO = 0.999
"""Pressure ratio above which the flow is continued with a finite slope."""
TOLERANCES = (1e-12, *9 * (1e-9,))
"""Relative tolerances of a fit, by round of evaluations. Metered maps need a tenth of the first
round; where parameters stand at a bound the last digits may take thousands of evaluations."""
ROUND = 200
"""Evaluations in a round."""
SETTLED = 0.01
"""Fall of χ² in a round below which the rest does not count: a tenth of a standard deviation."""


def orifice_expression(
    C: Any,
    b: Any,
    m: Any,
    p_1: Any,
    p_2: Any,
    T: Any = T_ANR,
    laminar_ratio: Any = LAMINAR_RATIO,
) -> Any:
    r"""Return the mass flow [kg/s] from side 1 to side 2 of a restriction, a CasADi expression.

    .. math:: q = C p_1 ρ_0 \sqrt{T_0/T} ω,
              ω = (1 - ((p_2/p_1 - b)/(1 - b))^2)^m, \quad ω = 1 \text{ for } p_2/p_1 ≤ b

    and the same with sides exchanged, negative, where p_2 > p_1.

    Parameters
    ----------
    C : expression
        Sonic conductance [m³/(s Pa)].
    b, m : expression
        Critical pressure ratio and subsonic index [1].
    p_1, p_2 : expression
        Absolute pressures on either side [Pa].
    T : expression, optional
        Upstream temperature [K].
    laminar_ratio : float, optional
        For min(p)/max(p) above this ratio, where ω has an infinite slope and real flow turns
        laminar, ω is replaced by an odd cubic in 1 − ratio that joins it in value and slope.

    Notes
    -----
    C¹ in both pressures and both directions, also at equal pressures and at the choking point.

    References
    ----------
    .. [1] ISO 6358-1:2013, eq. 3 to 5 (m free; the older standard fixes m = 0.5).
    """
    high = ca.fmax(p_1, p_2)
    drop = (p_1 - p_2) / high
    edge = 1.0 - laminar_ratio
    omega = _subsonic(1.0 - ca.fmax(ca.fabs(drop), edge), b) ** m
    # Relative slope d(ln ω)/d(ln drop) where the cubic takes over; m for an orifice with b = 0.5.
    ratio = (laminar_ratio - b) / (1.0 - b)
    slope = 2.0 * m * ratio * edge / ((1.0 - b) * (1.0 - ratio * ratio))
    near = ca.fmin(ca.fmax(drop / edge, -1.0), 1.0)
    signed = near * (3.0 - slope + (slope - 1.0) * near * near) / 2.0
    return C * high * RHO_ANR * np.sqrt(T_ANR) / ca.sqrt(T) * omega * signed


def _subsonic(ratio: Any, b: Any) -> Any:
    excess = ca.fmax((ratio - b) / (1.0 - b), 0.0)
    return 1.0 - excess * excess


@cache
def _orifice_function() -> ca.Function:
    theta = ca.SX.sym("theta", 3)
    p_1, p_2, T, laminar = (ca.SX.sym(name) for name in ("p_1", "p_2", "T", "laminar_ratio"))
    q = orifice_expression(theta[0], theta[1], theta[2], p_1, p_2, T, laminar)
    return ca.Function("q_m", [theta, p_1, p_2, T, laminar], [q, ca.jacobian(q, theta).T])


def orifice_flow(
    C: float,
    b: float,
    m: float,
    p_1: ArrayLike,
    p_2: ArrayLike,
    T: float = T_ANR,
    laminar_ratio: float = LAMINAR_RATIO,
) -> FloatArray:
    """Return the mass flow [kg/s] from side 1 to side 2 for arrays of pressures that broadcast.

    The equation is that of `orifice_expression`.

    Parameters
    ----------
    C : float
        Sonic conductance [m³/(s Pa)].
    b, m : float
        Critical pressure ratio and subsonic index [1].
    p_1, p_2 : array_like
        Absolute pressures on either side [Pa].
    T : float, optional
        Upstream temperature [K].
    laminar_ratio : float, optional
        Ratio of the pressures from which the flow is laminar [1].

    Examples
    --------
    A valve of 2 litre/(s bar), choked from 7 bar absolute: 14 litre (ANR) per second.

    >>> round(float(orifice_flow(2e-8, 0.3, 0.5, 7e5, 1e5)), 5)
    0.01659
    """
    upstream, downstream = np.broadcast_arrays(
        np.asarray(p_1, dtype=float), np.asarray(p_2, dtype=float)
    )
    if not upstream.size:
        return np.zeros(upstream.shape)
    theta = np.tile([[C], [b], [m]], (1, upstream.size))
    q, _ = _orifice_function()(
        theta, upstream.reshape(1, -1), downstream.reshape(1, -1), T, laminar_ratio
    )
    return np.asarray(q, dtype=float).reshape(upstream.shape)


@dataclass(frozen=True, slots=True, eq=False)
class Orifice:
    """A restriction fitted to measured flows.

    Parameters
    ----------
    parameters : Parameters
        ``C`` [m³/(s Pa)], ``b`` and ``m`` [1].
    covariance : (3, 3) array
        Their covariance; infinite variance where a parameter stands at its bound.
    sigma : float
        Standard deviation of the residuals [kg/s].
    T : float
        Upstream temperature [K].
    laminar_ratio : float
        See `orifice_expression`.
    """

    parameters: Parameters
    covariance: FloatArray
    sigma: float
    T: float = T_ANR
    laminar_ratio: float = LAMINAR_RATIO

    def __call__(self, p_1: ArrayLike, p_2: ArrayLike) -> FloatArray:
        """Return the mass flow [kg/s] from side 1 to side 2."""
        C, b, m = self.parameters.values
        return orifice_flow(C, b, m, p_1, p_2, self.T, self.laminar_ratio)


def fit_orifice(
    p_1: ArrayLike,
    p_2: ArrayLike,
    q_m: ArrayLike,
    T: float = T_ANR,
    laminar_ratio: float = LAMINAR_RATIO,
) -> Orifice:
    """Fit C, b and m of ISO 6358 to flows measured at one opening.

    Parameters
    ----------
    p_1, p_2 : (n,) array
        Absolute pressures upstream and downstream [Pa]; several supply pressures may be mixed.
    q_m : (n,) array
        Mass flow from 1 to 2 [kg/s].
    T : float, optional
        Upstream temperature [K].
    laminar_ratio : float, optional
        See `orifice_expression`.

    Raises
    ------
    CaseError
        If there are fewer than four points or a value is not plausible.
    FitError
        If the least-squares iteration stalls; ``partial`` holds its result.
    """
    upstream, downstream, q = (np.array(values, dtype=float) for values in (p_1, p_2, q_m))
    if not (
        upstream.ndim == 1 and upstream.shape == downstream.shape == q.shape and upstream.size > 3
    ):
        raise CaseError(
            f"p_1, p_2 and q_m must be vectors of one length, at least 4, got shapes "
            f"{upstream.shape}, {downstream.shape}, {q.shape}"
        )
    # Curves are metered down to vacuum; only a value that cannot be Pa is refused.
    if not (
        np.isfinite([upstream, downstream, q]).all()
        and upstream.min() >= P_PLAUSIBLE[0]
        and downstream.min() >= 0
    ):
        raise CaseError(
            f"p_1 from {upstream.min():g} Pa, p_2 from {downstream.min():g} Pa: expected finite "
            "absolute pressures in Pa and flows in kg/s; is it in bar, psi or a gauge pressure?"
        )
    start = np.abs(q).max() / (
        np.maximum(upstream, downstream).max() * RHO_ANR * np.sqrt(T_ANR / T)
    )
    guess = Parameters(
        [
            Parameter("C", start, "m³/(s Pa)", lower=0.0, scale=start, source="ISO 6358-1:2013"),
            Parameter("b", 0.3, "1", lower=0.0, upper=0.95, scale=0.1, source="ISO 6358-1:2013"),
            Parameter("m", 0.5, "1", lower=0.1, upper=2.0, scale=0.1, source="ISO 6358-1:2013"),
        ]
    )
    fixed = (upstream.reshape(1, -1), downstream.reshape(1, -1), T, laminar_ratio)

    def evaluate(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        flows, jacobian = _orifice_function()(np.tile(theta[:, None], (1, q.size)), *fixed)
        return np.asarray(flows)[0] - q, np.asarray(jacobian).T

    fitted, covariance, sigma = bounded_least_squares(evaluate, guess, float(np.abs(q).max()))
    return Orifice(fitted, covariance, sigma, T, laminar_ratio)


def bounded_least_squares(
    evaluate: Evaluation, guess: Parameters, size: float
) -> tuple[Parameters, FloatArray, float]:
    """Minimise the sum of squared residuals within the bounds of the parameters.

    Parameters
    ----------
    evaluate : callable
        theta (n,) -> residuals (N,) and their Jacobian (N, n); asked once for each theta.
    guess : Parameters
        Start, bounds and scales.
    size : float
        Size of the measured quantity, by which residuals are divided.

    Returns
    -------
    Parameters, (n, n) array, float
        Estimates, covariance and residual standard deviation. A parameter at its bound has
        infinite variance and no covariance with the others.

    Raises
    ------
    FitError
        If the cost still falls when the evaluations are used up.
    """
    scale = guess.scales

    last: tuple[FloatArray, FloatArray, FloatArray] | None = None

    def at(z: FloatArray) -> tuple[FloatArray, FloatArray]:
        nonlocal last
        if last is None or not np.array_equal(last[0], z):
            values, slopes = evaluate(z * scale)
            last = z.copy(), values / size, slopes * scale / size
        return last[1], last[2]

    def scaled_residuals(z: FloatArray) -> FloatArray:
        return at(z)[0]

    def scaled_jacobian(z: FloatArray) -> FloatArray:
        return at(z)[1]

    solution = _settled(
        partial(
            least_squares,
            scaled_residuals,
            jac=scaled_jacobian,
            bounds=(guess.lower / scale, guess.upper / scale),
            method="trf",
            max_nfev=ROUND,
        ),
        guess.values / scale,
    )
    theta = np.clip(solution.x * scale, guess.lower, guess.upper)
    inside = np.minimum(theta - guess.lower, guess.upper - theta) > 1e-6 * scale
    J = np.asarray(solution.jac, dtype=float)[:, inside]
    dof = len(solution.fun) - int(inside.sum())
    variance = float(solution.fun @ solution.fun) / dof
    covariance = np.diag(np.where(inside, 0.0, np.inf))
    covariance[np.ix_(inside, inside)] = (
        variance * np.linalg.pinv(J.T @ J) * np.outer(scale[inside], scale[inside])
    )
    return guess.with_values(theta), covariance, float(np.sqrt(variance) * size)


def _settled(solve: Callable[..., Any], start: FloatArray) -> Any:
    """Return the solution of rounds of least squares, each from the end of the last one.

    A round that uses up its evaluations is the last where the cost has stopped falling.

    Raises
    ------
    FitError
        If the cost still falls after the last round.
    """
    cost, n_evaluations = np.inf, 0
    for tolerance in TOLERANCES:
        solution = solve(x0=start, xtol=tolerance, ftol=tolerance, gtol=tolerance)
        n_evaluations += solution.nfev
        dof = max(len(solution.fun) - len(start), 1)
        if solution.success or (cost - solution.cost) * dof < SETTLED * solution.cost:
            return solution
        start, cost = solution.x, solution.cost
    raise FitError(
        f"ISO 6358 fit stalled after {n_evaluations} evaluations at a cost of "
        f"{solution.cost:g}: {solution.message}; start nearer or meter more points",
        solution,
    )
