"""Residuals of the balances along a smoothed motion; states of the effects are simulated."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.estimation.equation_error.balance_functions import (
    BalanceFunctions,
    any_sensor_effect,
)
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion
from pneumo_casadi.parameters import FloatArray

#: Iterations that invert the effects of sensors, each accurate to one order more.
CORRECTIONS = 6
#: The iterations end once they change no signal by more than this share of its noise.
UNCHANGED = 1e-4
#: Step of difference quotients, in units of the scale of a parameter.
DIFFERENCE = 1e-3

#: Nominal states and their derivatives, each (n, N).
Motion = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class LinearisedResiduals:
    """Residuals of the balances at every row of a record.

    Parameters
    ----------
    r : (ne, m) array
        In the units of `BalanceFunctions.residual`.
    J : (ne, m, n) array
        Derivatives to the free parameters, in the order of `BalanceFunctions.free`.
    """

    r: FloatArray
    J: FloatArray


def balance_residuals(
    model: BalanceFunctions, data: SmoothedMotion, theta: FloatArray
) -> FloatArray:
    """Return the decimated residuals at some parameters, shape (ne, m)."""
    return residuals_of_variants(model, data, [theta])[0]


def residuals_of_variants(
    model: BalanceFunctions, data: SmoothedMotion, variants: Sequence[FloatArray]
) -> list[FloatArray]:
    """Return the decimated residuals for every variant of θ, each (ne, m)."""
    return [
        _removing_swings(model, data, theta)(data.averaged(r))
        for theta, r in zip(variants, _undecimated(model, data, variants), strict=True)
    ]


def linearise_residuals(
    model: BalanceFunctions, data: SmoothedMotion, theta: FloatArray, whole: bool = False
) -> LinearisedResiduals:
    """Return residuals and derivatives at some parameters.

    Derivatives to the nominal parameters hold the states of the effects, and are exact where these
    states do not depend on them. Derivatives to parameters of effects are exact where no state and
    no sensor depends on them, and difference quotients otherwise. With `whole`, difference
    quotients are also used for nominal parameters on which states depend, at the price of one
    simulation of the states for each.
    """
    holding = model.state_dependent if whole else ()
    variants, step_sizes = _perturbed(model, theta, (*model.by_difference, *holding), {})
    residuals = _undecimated(model, data, variants, jacobian=True)
    r, J = residuals[0], residuals[-1]
    ne, k = len(r), len(step_sizes)
    moved = [(perturbed - r) / h for perturbed, h in zip(residuals[1:-1], step_sizes, strict=True)]
    low = np.concatenate([data.averaged(part) for part in (r, J, *moved)])
    derivatives = low[ne:].reshape(-1, ne, data.m).transpose(1, 2, 0)
    exact, quotients = np.split(derivatives, [derivatives.shape[2] - k], axis=2)
    own = len(model.by_difference)
    exact[:, :, [model.analytic.index(name) for name in holding]] = quotients[:, :, own:]
    J = np.concatenate([exact, quotients[:, :, :own]], axis=2)
    without_swings = _removing_swings(model, data, theta)
    J = without_swings(J.transpose(2, 0, 1)).transpose(1, 2, 0)
    return LinearisedResiduals(without_swings(low[:ne]), J)


def effect_derivatives(
    model: BalanceFunctions,
    data: SmoothedMotion,
    theta: FloatArray,
    names: Sequence[str],
    sizes: Mapping[str, float] | None = None,
) -> FloatArray:
    """Return derivatives of the residuals to parameters of the effects, shape (ne, m, k).

    With `sizes`, the quotients over steps of those sizes by name.
    """
    variants, step_sizes = _perturbed(model, theta, names, sizes or {})
    residuals = _undecimated(model, data, variants)
    moved = [
        (perturbed - residuals[0]) / h
        for perturbed, h in zip(residuals[1:], step_sizes, strict=True)
    ]
    ne, k = len(residuals[0]), len(names)
    low = np.array([data.averaged(part) for part in moved]).reshape(k, ne, data.m)
    return _removing_swings(model, data, theta)(low).transpose(1, 2, 0)


def _removing_swings(
    model: BalanceFunctions, data: SmoothedMotion, theta: FloatArray
) -> Callable[[FloatArray], FloatArray]:
    """Return what takes from rows (..., ne, m) how the force swings on from the record's beginning.

    A load on a spring goes on swinging for seconds, and how it did when a record begins nobody has
    measured. What it adds to the rows of the force, e^{s t} for each of its poles s, is fitted to
    them and taken away (variable projection, Golub and Pereyra 1973).
    """
    axis = model.axis
    values = dict(zip(axis.parameters.names, theta.tolist(), strict=True))
    poles: list[complex] = []
    for effect in axis.effects:
        own = {item.name: values[f"{effect.name}.{item.name}"] for item in effect.parameters}
        poles += effect.swings(own)
    if not poles:
        return lambda rows: rows
    waves = np.exp(np.outer(poles, np.arange(data.m) / data.row_rate))
    C, force = np.vstack([waves.real, waves.imag]), axis.equations.index("force")
    used = data.used(axis)[force]
    amplitudes = np.linalg.pinv(C * used)

    def without(rows: FloatArray) -> FloatArray:
        left = rows.copy()
        left[..., force, :] -= (rows[..., force, :] * used) @ amplitudes @ C
        return left

    return without


def _perturbed(
    model: BalanceFunctions,
    theta: FloatArray,
    names: Sequence[str],
    sizes: Mapping[str, float],
) -> tuple[list[FloatArray], list[float]]:
    """Return θ, copies of it with one parameter perturbed each, and the perturbations."""
    parameters = model.axis.parameters
    variants, step_sizes = [theta], []
    for name in names:
        item, at = parameters[name], parameters.index(name)
        h = sizes.get(name, DIFFERENCE * item.scale)
        if theta[at] + h > item.upper:
            h = -h
        moved = theta.copy()
        moved[at] += h
        variants.append(moved)
        step_sizes.append(h)
    return variants, step_sizes


def _undecimated(
    model: BalanceFunctions,
    data: SmoothedMotion,
    variants: Sequence[FloatArray],
    jacobian: bool = False,
) -> list[FloatArray]:
    """Return r (ne, N) for every variant of θ, and last the Jacobian of the first (ne n, N)."""
    motions = true_motions(model, data, variants)
    states = simulate_effect_states(model, data, variants, motions)
    residuals: list[FloatArray] = []
    jacobians: list[FloatArray] = []
    c, functions = model.constant_values, model.functions
    for i, (theta, z, (x, dx)) in enumerate(zip(variants, states, motions, strict=True)):
        given = (x, dx, data.u, z, c, theta)
        if jacobian and i == 0:
            r, slope = functions["residual_and_jacobian"].evaluate(data.N, *given)
            jacobians = [slope]
        else:
            (r,) = functions["residual"].evaluate(data.N, *given)
        residuals.append(r)
    return residuals + jacobians


def true_motions(
    model: BalanceFunctions, data: SmoothedMotion, variants: Sequence[FloatArray]
) -> list[Motion]:
    """Return the motions with the effects of sensors inverted, for every variant of θ."""
    sensors, names = model.sensors, model.axis.parameters.names
    shared = [names.index(name) for name in sensors.axis.parameters.names]
    own = [names.index(name) for name in sensors.axis.parameters.names if "." in name]
    # A sensor effect depends on its own parameters alone: equal variants share a motion.
    distinct = {theta[own].tobytes(): theta[shared] for theta in variants}
    corrected = _without_sensors(sensors, data, list(distinct.values()))
    known = dict(zip(distinct, corrected, strict=True))
    return [known[theta[own].tobytes()] for theta in variants]


def _without_sensors(
    model: BalanceFunctions, data: SmoothedMotion, variants: Sequence[FloatArray]
) -> list[Motion]:
    motions = [(data.x, data.dx)] * len(variants)
    effects = model.axis.effects
    for _ in range(CORRECTIONS if any_sensor_effect(effects) else 0):
        states = simulate_effect_states(model, data, variants, motions)
        last = motions
        motions = [
            _corrected(model, data, theta, z, motion)
            for theta, z, motion in zip(variants, states, motions, strict=True)
        ]
        if _distance(model, data, last, motions) < UNCHANGED:
            break
    return motions


def _distance(
    model: BalanceFunctions, data: SmoothedMotion, first: Sequence[Motion], second: Sequence[Motion]
) -> float:
    """Return the largest difference of two sets of motions, in units of the sensors' noise."""
    rows = [model.axis.motion_states.index(name) for name in model.axis.outputs]
    apart = [
        np.abs(a[rows] - b[rows]).max(axis=1) for (a, _), (b, _) in zip(first, second, strict=True)
    ]
    return float(np.max(np.max(apart, axis=0) / np.maximum(data.noise, 1e-300)))


def simulate_effect_states(
    model: BalanceFunctions,
    data: SmoothedMotion,
    variants: Sequence[FloatArray],
    motions: Sequence[Motion],
) -> list[FloatArray]:
    """Simulate the states of the effects along the motions; (nz, N) for each variant of θ."""
    if not model.n_z:
        return [np.zeros((0, data.N))] * len(variants)
    # From one row to the next an input that is held has both its values, half the time each.
    between = np.asfortranarray((data.u + np.hstack([data.u[:, 1:], data.u[:, -1:]])) / 2)
    constant = np.array([data.dt]), model.constant_values
    driving = {id(motion): _now_and_next(motion) for motion in motions}
    given = [
        (_at_rest(model, data, theta, motion), *driving[id(motion)], between, *constant, theta)
        for theta, motion in zip(variants, motions, strict=True)
    ]
    return [z[:, : data.N] for z in model.step.accumulate(data.N, given)]


def _at_rest(
    model: BalanceFunctions, data: SmoothedMotion, theta: FloatArray, motion: Motion
) -> FloatArray:
    """Return the states with which a record begins, (nz,)."""
    first = (*(part[:, 0] for part in (*motion, data.u)), np.zeros(model.n_z))
    (z,) = model.functions["rest"].evaluate(1, *first, model.constant_values, theta)
    # The clock: filters take the first samples of a record.
    return np.asarray(z[:, 0] + data.t[0] * model.clocks)


def _now_and_next(motion: Motion) -> list[FloatArray]:
    """Return both parts of a motion at every sample and at the next one."""
    both = []
    for part in motion:
        longer = np.asfortranarray(np.column_stack([part, part[:, -1]]))
        both += [longer[:, :-1], longer[:, 1:]]
    return both


def _corrected(
    model: BalanceFunctions,
    data: SmoothedMotion,
    theta: FloatArray,
    z: FloatArray,
    motion: Motion,
) -> Motion:
    """Return a motion that the sensors show more nearly as it was measured."""
    axis = model.axis
    x, dx = motion
    given = (x, dx, data.u, z, model.constant_values, theta)
    (y,) = model.functions["shown"].evaluate(data.N, *given)
    x_new, dx_new = x.copy(), dx.copy()
    for i, name in enumerate(axis.outputs):
        row = axis.motion_states.index(name)
        missing = data.x[row] - y[i]
        if not missing.any():  # no effect acts on this sensor
            continue
        shift = _put_ahead(data, data.smooth(missing), x[row] - y[i], y[i])
        x_new[row] = x[row] + shift
        rate = data.derivative(shift)
        dx_new[row] = dx[row] + rate
        if name == "x":
            v = axis.motion_states.index("v")
            x_new[v] = x[v] + rate
            dx_new[v] = dx[v] + data.derivative(rate)
    return x_new, dx_new


def _put_ahead(
    data: SmoothedMotion, shift: FloatArray, late: FloatArray, shown: FloatArray
) -> FloatArray:
    """Return a correction put ahead by what a sensor is late.

    What the signal is ahead of what is shown, by T ẏ + K ÿ in the mean over the record, is added
    to the correction in the same way. Sensors with lags of first and second order are then
    inverted at once, where corrections as they are shown do not settle near a resonance.
    """
    T, K = _lateness(late, *_rates(data, shown))
    rate, acceleration = _rates(data, shift)
    return np.asarray(shift + T * rate + K * acceleration)


def _rates(data: SmoothedMotion, signal: FloatArray) -> tuple[FloatArray, FloatArray]:
    rate = data.derivative(signal)
    return rate, data.derivative(rate)


def _lateness(late: FloatArray, rate: FloatArray, acceleration: FloatArray) -> FloatArray:
    """Return T [s] and K [s²] of late = T rate + K acceleration, by least squares."""
    scale = 1 / max(float(np.sqrt(rate @ rate)), 1e-300)
    squares = np.column_stack([rate, acceleration]) * scale
    weights = np.maximum(np.sqrt(np.sum(squares**2, axis=0)), 1e-300)
    return np.linalg.lstsq(squares / weights, late * scale, rcond=None)[0] / weights
