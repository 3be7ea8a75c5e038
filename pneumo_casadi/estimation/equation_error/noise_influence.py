"""What sensor noise does to an equation-error fit: bias and scatter of its estimates.

Noise in the smoothed motion stands in the residuals and in their derivatives alike, so that it does
not only scatter the estimates but shifts them (errors in variables).
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.data import Recording
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.fit import default_residual_floor
from pneumo_casadi.estimation.equation_error.problem import Linearised, Problem, Trial
from pneumo_casadi.estimation.equation_error.smoothed_motion import (
    SmoothedMotion,
    coloured_velocity_noise,
    smooth_motion,
)
from pneumo_casadi.estimation.flow_anchor import Anchor
from pneumo_casadi.estimation.robust_covariance import default_lags, wider_sandwich
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.threads import one_thread
from pneumo_casadi.signals.noise_at_rest import sensor_noises
from pneumo_casadi.signals.sensor_noise import SensorNoise

#: Noise of the sensors by record.
Noises = Sequence[Mapping[str, SensorNoise]]
#: Sets of records with noise added.
REPLICATES = 8
#: Directions of the parameters weaker than this share of the strongest are not told.
RANK_TOLERANCE = 1e-12


@dataclass(frozen=True, eq=False)
class NoiseInfluence:
    """Bias and covariance of the estimates of an equation-error fit.

    Parameters
    ----------
    names : tuple of str
        Free parameters that are not at a bound and that the records tell of.
    bias : (n,) array
        What sensor noise has moved the estimates [SI].
    covariance : (n, n) array
        Of the estimates less their bias [SI].
    """

    names: tuple[str, ...]
    bias: FloatArray
    covariance: FloatArray

    @property
    def std(self) -> FloatArray:
        """Standard deviations of the estimates less their bias, (n,) [SI]."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))


def estimate_noise_influence(
    axis: Axis,
    records: Sequence[Recording],
    anchor: Anchor | None,
    executor: Executor | None = None,
) -> NoiseInfluence:
    """Estimate what sensor noise does to the estimates of an equation-error fit.

    Parameters
    ----------
    axis : Axis
        With the estimated parameters.
    records : sequence of Recording
        Those that were fitted.
    anchor : Anchor or None
        Residuals of the flow map in the fit.
    executor : concurrent.futures.Executor, optional
        Where noise is added; by default in this process.

    Returns
    -------
    NoiseInfluence

    Raises
    ------
    ModelError
        If no parameter is free.
    FitError
        If noise leaves too few rows in motion, or residuals that are no numbers.

    Notes
    -----
    Simulation and extrapolation (Cook and Stefanski 1994, J. Am. Stat. Assoc. 89, 1314-1328): noise
    as the sensors have it is added to the records once more, and what one Gauss-Newton step then
    moves the estimates is what the first noise has moved them. The covariance is that of residuals
    correlated in time, `wider_sandwich`, plus that of the bias, a mean of few replicates. Rows in
    which noise that is not white may have turned the sign of the velocity are left out, although
    `fit_equation_error` keeps them (see `smooth_motion`): the bias contains what they have moved.

    Examples
    --------
    >>> from pneumo_casadi.data import ForceBench, InputHold, NestedController
    >>> from pneumo_casadi.estimation.equation_error import fit_equation_error
    >>> from pneumo_casadi.model.servosystem import ForceAxis
    >>> from pneumo_casadi.model.simulation import simulate
    >>> axis = ForceAxis(ForceBench(1e3, 0.5, NestedController(30.0, 60.0, 1.0, 60.0)))
    >>> truth = {"M": 18.0, "f_v": 25.0, "F_c_plus": 12.0, "F_c_minus": 17.0}
    >>> t = np.arange(4000) / 1e3
    >>> F = 60.0 * np.sin(2 * np.pi * t)
    >>> run = simulate(axis.with_parameters(truth), F[:, None], 1e-3, [0.0, 0.0])
    >>> x = run["x"] + np.random.default_rng(0).normal(0.0, 1e-5, t.size)
    >>> record = Recording(t, {"F": F, "x": x}, "sine", "simulated", InputHold.ZERO)
    >>> fitted = fit_equation_error(axis, [record]).axis
    >>> influence = estimate_noise_influence(fitted, [record], None)
    >>> influence.names[0], bool(abs(influence.bias[0]) < influence.std[0] < 0.1)
    ('M', True)
    """
    if not axis.parameters.free_names:
        raise ModelError("no parameter is free: release some with `Parameters.release`")
    of_x = zip(records, sensor_noises(records, "x"), strict=True)
    slow = [coloured_velocity_noise(record, noise) for record, noise in of_x]
    problem, linear = _linearised(axis, anchor, records, slow)
    theta = axis.parameters.values
    lower, upper = problem.bounds
    inside = (theta[problem.free] > lower) & (theta[problem.free] < upper)
    inside &= np.linalg.norm(linear.A, axis=0) != 0  # of the others the records say nothing
    at_first = _step(linear, inside)
    sensors = (*axis.outputs, *(axis.inputs if axis.kind.measured_inputs else ()), "v", "a")
    noises: list[dict[str, SensorNoise]] = [{} for _ in records]
    for name in dict.fromkeys(sensors):
        having = [k for k, record in enumerate(records) if name in record]
        every = sensor_noises([records[k] for k in having], name)
        for k, noise in zip(having, every, strict=True):
            noises[k][name] = noise
    rng = np.random.default_rng(0)
    noisier = (_noisier(records, noises, rng) for _ in range(REPLICATES))
    run = map if executor is None else executor.map
    moved = list(run(partial(_step_along, axis, anchor, slow, inside), noisier))
    shifts = [step - at_first for step in moved]
    scales = problem.scales[inside]
    of_bias = np.atleast_2d(np.cov(shifts, rowvar=False)) / REPLICATES
    return NoiseInfluence(
        tuple(name for name, free in zip(problem.model.free, inside, strict=True) if free),
        (np.mean(shifts, axis=0) - at_first) * scales,
        (_covariance(problem, linear, inside) + of_bias) * np.outer(scales, scales),
    )


def _linearised(
    axis: Axis, anchor: Anchor | None, records: Sequence[Recording], slow: Sequence[float]
) -> tuple[Problem, Linearised]:
    """Linearise the fit to records smoothed with given noise of the velocity.

    With the same noise the rows that count stay where noise is added.
    """
    model = BalanceFunctions(axis)
    pairs = zip(records, slow, strict=True)
    smoothed = tuple(smooth_motion(axis, record, noise) for record, noise in pairs)
    floor = default_residual_floor(axis)
    problem = Problem(model, smoothed, anchor, floor, bool(model.state_dependent))
    if problem.n_rows.min() < len(model.free):
        raise FitError("noise leaves too few rows in which the sign of the velocity is sure")
    return problem, problem.linearise(Trial(axis.parameters.values, np.inf))


@one_thread
def _step_along(
    axis: Axis,
    anchor: Anchor | None,
    slow: Sequence[float],
    inside: NDArray[np.bool_],
    records: Sequence[Recording],
) -> FloatArray:
    """Return the Gauss-Newton step of the parameters within their bounds along records."""
    return _step(_linearised(axis, anchor, records, slow)[1], inside)


def _noisier(
    records: Sequence[Recording], noises: Noises, rng: np.random.Generator
) -> list[Recording]:
    """Return records with noise added to some of their channels."""
    return [
        replace(
            record,
            channels=dict(record.channels)
            | {name: record[name] + each.draw(record.t.size, rng) for name, each in own.items()},
        )
        for record, own in zip(records, noises, strict=True)
    ]


def _inverse(A: FloatArray) -> FloatArray:
    """Return (AᵀA)⁻¹."""
    size = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    scaled = A / size
    inverse = np.linalg.pinv(scaled.T @ scaled, rcond=RANK_TOLERANCE, hermitian=True)
    return np.asarray(inverse / np.outer(size, size))


def _step(linear: Linearised, inside: NDArray[np.bool_]) -> FloatArray:
    """Return the Gauss-Newton step of the parameters within their bounds."""
    A = linear.A[:, inside]
    if not (np.isfinite(A).all() and np.isfinite(linear.e).all()):
        raise FitError("along noisier records the residuals of the balances are no numbers")
    return np.asarray(-_inverse(A) @ (A.T @ linear.e))


def _covariance(problem: Problem, linear: Linearised, inside: NDArray[np.bool_]) -> FloatArray:
    """Return the covariance of the scaled parameters, residuals correlated in time."""
    A = linear.A[:, inside]
    inverse = _inverse(A)
    counts = problem.weights.ravel() > 0
    rows = counts.size
    balance = np.repeat(np.arange(len(problem.weights)), problem.weights.shape[1])
    instant = np.tile(_instants(problem.motions), len(problem.weights))
    # The points of the flow map, and what effects know of themselves, come with their own noise.
    known = A[rows:] @ inverse
    return np.asarray(
        known.T @ known
        + wider_sandwich(
            inverse, A[:rows][counts], linear.e[:rows][counts], balance[counts], instant[counts]
        )
    )


def _instants(motions: Sequence[SmoothedMotion]) -> Any:
    """Return the instants of all rows, records so far apart that none correlates with the next."""
    apart = default_lags(sum(motion.m for motion in motions)) + 1
    starts = np.cumsum([0, *(motion.m + apart for motion in motions[:-1])])
    return np.concatenate(
        [start + np.arange(motion.m) for start, motion in zip(starts, motions, strict=True)]
    )
