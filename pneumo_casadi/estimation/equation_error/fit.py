"""Equation-error estimation: bounded, weighted least squares on the residuals of the balances."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.data import Recording
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.residuals import balance_residuals, linearise_residuals
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion, smooth_motion
from pneumo_casadi.estimation.flow_anchor import Anchor, anchor_flow
from pneumo_casadi.estimation.gauss_newton import Damping, Status, minimise, minimise_in_box
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.valve import AnyFlowMap

MAX_ITERATIONS = 30
#: A step that predicts less than this decrease of the cost per row ends the iteration.
TOLERANCE = 1e-5
DAMPING = Damping(
    start=1e-6,
    accept=1e-3,
    trust=1e-3,
    fall=10.0,
    grow=10.0,
    least=1e-9,
    least_after_rejection=1e-6,
    max_rejections=12,
)
#: From this iteration on an accepted step is doubled while that lowers the cost, at most so many
#: times. In a curved valley, and where the derivatives hold the states of the effects, steps all
#: point the same way and are short.
DOUBLE_FROM, MAX_DOUBLINGS = 3, 6


@dataclass(frozen=True, eq=False, repr=False)
class EquationErrorResult:
    """Parameters that minimise the residuals of the balances.

    Parameters
    ----------
    axis : Axis
        The model with the estimated parameters.
    names : tuple of str
        Estimated parameters, in the order of `covariance`.
    covariance : (n, n) array
        In SI units, residuals taken for white.
    cost : float
        Σ_e n_e log σ_e over the balances, plus half the sum of squares of the flow map's
        residuals: the negative log-likelihood but for a constant.
    residuals : tuple of (ne, m) array
        By record, rows that were not used included [Pa/s, Pa/s, N]; of a force-driven axis
        divided by the mass [m/s²].
    used : tuple of (ne, m) array of bool
        Rows that were used: those of the force balance only in motion.
    converged : bool
        False where the iterations were exhausted or no step lowered the cost.
    model : BalanceFunctions
        The balances as functions of the motion, compiled.
    """

    axis: Axis
    names: tuple[str, ...]
    covariance: FloatArray
    cost: float
    residuals: tuple[FloatArray, ...]
    used: tuple[NDArray[np.bool_], ...]
    converged: bool
    model: BalanceFunctions

    @property
    def parameters(self) -> Parameters:
        """All parameters with their estimated values."""
        return self.axis.parameters

    @property
    def std(self) -> dict[str, float]:
        """Standard deviation of each estimated parameter, in SI units."""
        variances = np.maximum(np.diag(self.covariance), 0.0)  # rounding may leave less than zero
        return dict(zip(self.names, np.sqrt(variances).tolist(), strict=True))

    def residuals_of(self, motion: SmoothedMotion) -> FloatArray:
        """Return the residuals (ne, m) along another motion, for example one held out."""
        return balance_residuals(self.model, motion, self.parameters.values)

    def __repr__(self) -> str:
        """Return the main figures in one line."""
        state = "converged" if self.converged else "not converged"
        rows = sum(int(used.sum()) for used in self.used)
        return (
            f"EquationErrorResult({state}, {len(self.names)} parameters, {rows} rows, "
            f"cost {self.cost:.6g})"
        )


def fit_equation_error(
    axis: Axis,
    records: Sequence[Recording | SmoothedMotion],
    flow_map: AnyFlowMap | Anchor | None = None,
    *,
    residual_floor: FloatArray | None = None,
    state_derivatives: bool = False,
) -> EquationErrorResult:
    r"""Estimate the free parameters of an axis from the residuals of its balances.

    The balances r(x, ẋ, u; θ) are evaluated along the measured motion, smoothed, and not
    simulated:

    .. math:: \hat\theta = \arg\min_\theta \sum_e n_e \log \sigma_e(\theta)
              + \tfrac12 \lVert r_{map}(\theta) \rVert^2, \qquad
              \sigma_e^2 = \frac{1}{n_e} \sum_k r_e(t_k; \theta)^2 + \sigma_{0,e}^2

    The sum runs over the balances e. n_e is the number of rows used of a balance, σ_e the standard
    deviation of its residuals, and r_map are the residuals of the measured flow map, each divided
    by its standard deviation. That is the maximum likelihood for white residuals of unknown
    variance, within the bounds of the parameters. States of effects are simulated along the
    measured motion, and sensor effects are inverted.

    A fit takes milliseconds where output error takes seconds, and does not diverge from poor
    starting values, because nothing is integrated. The estimates are biased: noise and filters
    change them by a fraction of a per cent.

    Parameters
    ----------
    axis : Axis
        Its parameters are the start and tell what is free. Rows slower than 2 mm/s are left out
        of the force balance; at the other rows the smoothed sign tanh(v/v_s) is -1 or 1 within 4 %
        for a width ``v_s`` of 1 mm/s.
    records : sequence of Recording or SmoothedMotion
        Fitted together.
    flow_map : FlowMap or Anchor, optional
        Measured map, or its residuals; needed where the flow coefficients are free.
    residual_floor : (ne,) array, optional
        σ_0, the least standard deviation of the residuals of each balance [Pa/s, Pa/s, N; for a
        force-driven axis m/s²]; by default `default_residual_floor`. It keeps log σ_e finite.
    state_derivatives : bool, optional
        Whether derivatives with respect to the nominal parameters include the states of the
        effects. It costs one simulation of these states per parameter; without it a fit may stop
        before the minimum.

    Returns
    -------
    EquationErrorResult

    Raises
    ------
    ModelError
        If there is no record or no free parameter.
    CaseError
        If a record is too short for the filters.

    Notes
    -----
    Equation error as in Ljung (1999), *System Identification*, section 7.2. `fit_wls` is its
    special case of balances that are linear in the parameters, without a flow map and bounds.

    Examples
    --------
    >>> from pneumo_casadi.data import ForceBench, InputHold, NestedController
    >>> from pneumo_casadi.model.servosystem import ForceAxis
    >>> from pneumo_casadi.model.simulation import simulate
    >>> axis = ForceAxis(ForceBench(1e3, 0.5, NestedController(30.0, 60.0, 1.0, 60.0)))
    >>> truth = {"M": 18.0, "f_v": 25.0, "F_c_plus": 12.0, "F_c_minus": 17.0}
    >>> t = np.arange(4000) / 1e3
    >>> F = 60.0 * np.sin(2 * np.pi * t)
    >>> run = simulate(axis.with_parameters(truth), F[:, None], 1e-3, [0.0, 0.0])
    >>> record = Recording(t, {"F": F, "x": run["x"]}, "sine", "simulated", InputHold.ZERO)
    >>> result = fit_equation_error(axis, [record])
    >>> result.converged, round(result.parameters["M"].value, 1)
    (True, 18.0)
    """
    if not records:
        raise ModelError("no record to fit")
    if not axis.parameters.free_names:
        raise ModelError("no parameter is free: release some with `Parameters.release`")
    motions = tuple(
        record if isinstance(record, SmoothedMotion) else smooth_motion(axis, record)
        for record in records
    )
    anchor = flow_map if isinstance(flow_map, Anchor) else anchor_flow(axis, flow_map)
    floor = default_residual_floor(axis) if residual_floor is None else residual_floor
    problem = _Problem(BalanceFunctions(axis), motions, anchor, floor, state_derivatives)
    start = _Trial(axis.parameters.values, np.inf)
    trials = MAX_ITERATIONS * DAMPING.max_rejections
    minimum = minimise(problem, start, DAMPING, MAX_ITERATIONS, trials)
    assert minimum.linear is not None  # at least one iteration was asked for
    theta = minimum.point.theta
    residuals = problem.residuals(theta)
    inverse = np.linalg.pinv(minimum.linear.H, hermitian=True)
    return EquationErrorResult(
        axis.with_parameters(axis.parameters.with_values(theta)),
        problem.model.free,
        inverse * np.outer(problem.scales, problem.scales),
        problem.cost(residuals, theta),
        residuals,
        tuple(motion.used(axis) for motion in motions),
        minimum.status is Status.CONVERGED,
        problem.model,
    )


def default_residual_floor(axis: Axis) -> FloatArray:
    """Return the smallest residual of each balance that counts, (ne,), in units of the residuals.

    Far below what any sensor leaves: it keeps log σ finite on data without noise.
    """
    return np.array([balance.resolution for balance in axis.kind.balances])


@dataclass(frozen=True, slots=True)
class _Trial:
    """Values of all parameters and the cost there."""

    theta: FloatArray
    cost: float


@dataclass(frozen=True, slots=True)
class _Linearised:
    """Weighted residuals e at θ, A = ∂e/∂θ for the scaled free parameters, and H = AᵀA."""

    theta: FloatArray
    A: FloatArray
    e: FloatArray
    H: FloatArray
    cost: float


@dataclass(frozen=True, slots=True)
class _Step:
    """Step of the scaled free parameters and the decrease of the cost that it predicts."""

    delta: FloatArray
    gain: float


@dataclass(frozen=True, eq=False)
class _Problem:
    """The cost of parameters, as `minimise` asks for it."""

    model: BalanceFunctions
    motions: Sequence[SmoothedMotion]
    anchor: Anchor | None
    residual_floor: FloatArray
    state_derivatives: bool

    @cached_property
    def free(self) -> list[int]:
        return [self.model.axis.parameters.index(name) for name in self.model.free]

    @cached_property
    def scales(self) -> FloatArray:
        return self.model.axis.parameters.scales[self.free]

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        parameters = self.model.axis.parameters
        return parameters.lower[self.free], parameters.upper[self.free]

    @cached_property
    def weights(self) -> FloatArray:
        used = [motion.used(self.model.axis) for motion in self.motions]
        return np.hstack(used).astype(float)

    @cached_property
    def n_rows(self) -> FloatArray:
        return np.asarray(self.weights.sum(axis=1))

    def residuals(self, theta: FloatArray) -> tuple[FloatArray, ...]:
        return tuple(balance_residuals(self.model, motion, theta) for motion in self.motions)

    def map_residuals(self, theta: FloatArray) -> FloatArray:
        if self.anchor is None:
            return np.zeros(0)
        return self.anchor(self.anchor.coefficients(self.model.axis.parameters, theta))

    def cost(self, r: Sequence[FloatArray], theta: FloatArray) -> float:
        squares = float(np.sum(self.map_residuals(theta) ** 2))
        return float(np.sum(self.n_rows * np.log(self.sigma(r)))) + 0.5 * squares

    def sigma(self, r: Sequence[FloatArray]) -> FloatArray:
        squares = np.sum((np.hstack(r) * self.weights) ** 2, axis=1)
        return np.asarray(np.sqrt(squares / self.n_rows + self.residual_floor**2))

    def linearise(self, point: _Trial) -> _Linearised:
        theta = point.theta
        parts = [
            linearise_residuals(self.model, motion, theta, self.state_derivatives)
            for motion in self.motions
        ]
        r = [part.r for part in parts]
        weights = self.weights / self.sigma(r)[:, None]
        e = (np.hstack(r) * weights).ravel()
        A = (np.hstack([part.J for part in parts]) * weights[:, :, None]).reshape(e.size, -1)
        if self.anchor is not None:
            c = self.anchor.coefficients(self.model.axis.parameters, theta)
            A = np.vstack([A, self.anchor.rows(c, self.model.free)])
            e = np.concatenate([e, self.map_residuals(theta)])
        A = A * self.scales
        return _Linearised(theta, A, e, A.T @ A, self.cost(r, theta))

    def step(self, linear: _Linearised, damping: float) -> _Step:
        A, e, H = linear.A, linear.e, linear.H
        diagonal = np.diag(H)
        damped = H + damping * np.diag(np.maximum(diagonal, 1e-12 * diagonal.max()))
        lower, upper = ((b - linear.theta[self.free]) / self.scales for b in self.bounds)
        delta = minimise_in_box(damped, -A.T @ e, lower, upper)
        return _Step(delta, 0.5 * float(e @ e - np.sum((e + A @ delta) ** 2)))

    def settled(
        self, linear: _Linearised, step: _Step, damping: float, costs: Sequence[float]
    ) -> bool:
        return bool(step.gain < TOLERANCE * self.n_rows.sum())

    def take(self, linear: _Linearised, step: _Step, iteration: int) -> _Trial:
        best = self._at(linear.theta, step.delta)
        least_gain = DAMPING.accept * step.gain
        if iteration < DOUBLE_FROM or not best.cost < linear.cost - least_gain:
            return best
        for power in range(1, 1 + MAX_DOUBLINGS):
            trial = self._at(linear.theta, 2**power * step.delta)
            if not trial.cost < best.cost - least_gain:  # nor where it is no number
                break
            best = trial
        return best

    def _at(self, theta: FloatArray, delta: FloatArray) -> _Trial:
        """Return the trial after a scaled step, within the bounds against rounding."""
        ahead = theta.copy()
        ahead[self.free] = np.clip(theta[self.free] + delta * self.scales, *self.bounds)
        return _Trial(ahead, self.cost(self.residuals(ahead), ahead))
