"""Equation-error estimation: bounded, weighted least squares on the residuals of the balances."""

from collections.abc import Collection, Sequence

import numpy as np

from pneumo_casadi.data import Recording
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.problem import DAMPING, Linearised, Problem, Trial
from pneumo_casadi.estimation.equation_error.projected_costs import ProjectedCosts
from pneumo_casadi.estimation.equation_error.result import EquationErrorResult
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion, smooth_motion
from pneumo_casadi.estimation.flow_anchor import Anchor, anchor_flow
from pneumo_casadi.estimation.gauss_newton import Minimum, Status, minimise
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.valve import AnyFlowMap

MAX_ITERATIONS = 30
#: Iterations over which the pace of a fit is taken: single steps are erratic.
PACE_OVER = 3


def fit_equation_error(
    axis: Axis,
    records: Recording | SmoothedMotion | Sequence[Recording | SmoothedMotion],
    flow_map: AnyFlowMap | Anchor | None = None,
    *,
    residual_floor: FloatArray | None = None,
    state_derivatives: bool = False,
    max_iterations: int = MAX_ITERATIONS,
    least_gain: float | None = None,
) -> EquationErrorResult:
    r"""Estimate the free parameters of an axis from the residuals of its balances.

    The balances r(x, ẋ, u; θ) are evaluated along the measured motion, smoothed, and not
    simulated:

    .. math:: \hat\theta = \arg\min_\theta \sum_e n_e \log \sigma_e(\theta)
              + \tfrac12 \lVert r_{map}(\theta) \rVert^2, \qquad
              \sigma_e^2 = \frac{1}{n_e} \sum_k r_e(t_k; \theta)^2 + \sigma_{0,e}^2

    The sum runs over the balances e. n_e is the number of rows used of a balance, σ_e² the mean
    square of its residuals plus the floor σ₀², and r_map are the residuals of the measured flow
    map, each divided by its standard deviation. That is the maximum likelihood for white residuals
    of unknown variance, within the bounds of the parameters. States of effects are simulated along
    the measured motion, and sensor effects are inverted.

    A fit takes milliseconds where output error takes seconds, and does not diverge from poor
    starting values, because nothing is integrated. Noise and filters bias the estimates by a
    fraction of a per cent, noise of a sensor behind a slow filter by one or two;
    `estimate_noise_influence` tells how much.

    Parameters
    ----------
    axis : Axis
        Its parameters give the starting values and what is free. Rows slower than 2 mm/s are left
        out of the force balance; at the other rows the smoothed sign tanh(v/v_s) is -1 or 1 within
        4 % for a width ``v_s`` of 1 mm/s.
    records : Recording, SmoothedMotion or sequence of them
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
    max_iterations : int, optional
        Steps before giving up; `EquationErrorResult.pace` then tells how fast the cost still falls.
    least_gain : float, optional
        Decrease of the cost, a log-likelihood, below which the iteration ends; by default a
        hundred-thousandth times the number of rows of all balances.

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
    if isinstance(records, Recording | SmoothedMotion):
        records = (records,)
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
    problem = Problem(BalanceFunctions(axis), motions, anchor, floor, state_derivatives, least_gain)
    start = Trial(axis.parameters.values, np.inf)
    trials = max_iterations * DAMPING.max_rejections
    minimum = minimise(problem, start, DAMPING, max_iterations, trials)
    assert minimum.linear is not None  # at least one iteration was asked for
    theta = _last(problem, minimum).theta
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
        _pace(minimum),
        problem.model,
    )


def _last(problem: Problem, minimum: Minimum[Trial, Linearised]) -> Trial:
    """Return where one step more ends, without damping, if some effect has a prior.

    Directions that only a prior tells, as a curve where no record passes, promise too little to
    go on for, and would stay near where the fit began: other records may pass there. The step is
    taken if the fit has converged and the cost is no higher at its end.
    """
    linear = minimum.linear
    if minimum.status is not Status.CONVERGED or linear is None or not len(problem.prior):
        return minimum.point
    ahead = problem.take(linear, problem.step(linear, DAMPING.least), 0)
    return ahead if ahead.cost <= linear.cost else minimum.point


def _pace(minimum: Minimum[Trial, Linearised]) -> float:
    """Return the decrease of the cost per iteration where a fit was cut short, else 0."""
    if minimum.status is not Status.EXHAUSTED:
        return 0.0
    last = (*minimum.costs, minimum.point.cost)[-1 - PACE_OVER :]
    return (last[0] - last[-1]) / (len(last) - 1)


def equation_error_costs(
    axis: Axis,
    starts: Sequence[FloatArray],
    motions: Sequence[SmoothedMotion],
    anchor: Anchor | None = None,
    *,
    residual_floor: FloatArray | None = None,
    state_derivatives: bool = False,
    held: Collection[str] | None = None,
) -> list[float]:
    """Return the cost that `fit_equation_error` minimises, at some values of all parameters.

    With `held`, which may be empty, it is the cost after one linear step of all free parameters
    but those; see `ProjectedCosts`.
    """
    floor = default_residual_floor(axis) if residual_floor is None else residual_floor
    problem = Problem(BalanceFunctions(axis), motions, anchor, floor, state_derivatives)
    if held is None:
        return problem.costs(starts)
    return ProjectedCosts(problem, axis.parameters.values, held)(starts)


def default_residual_floor(axis: Axis) -> FloatArray:
    """Return the smallest residual of each balance that counts, (ne,), in units of the residuals.

    Far below what any sensor leaves: it keeps log σ finite on data without noise.
    """
    return np.array([balance.resolution for balance in axis.kind.balances])
