"""The motion behind what late or shifted sensors show, and the states of effects along it."""

from collections.abc import Mapping, Sequence
from weakref import WeakKeyDictionary, ref

import numpy as np

from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.equation_error.balance_functions import (
    BalanceFunctions,
    any_sensor_effect,
)
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion
from pneumo_casadi.model.machine_code.calls import call_with_arrays
from pneumo_casadi.parameters import FloatArray

#: At most so many iterations invert the effects of sensors.
CORRECTIONS = 6
#: They end with the first that changes every signal by less than this share of its sensor's noise,
#: root mean square: what is left of a lag lies where the smoothing filter ends, and settles slowly.
UNCHANGED = 0.02
#: The same beside a play or a delay that is corrected as it is shown: near the longest one that can
#: be, the corrections shrink so slowly that a small one tells little of what is left.
UNCHANGED_HIDDEN = 1e-4
#: K/T² of a lag of second order, 1/(2ζ)², with ζ = 0.3.
STRONGEST_SWING = 2.8

#: Nominal states and their derivatives, each (n, N).
Motion = tuple[FloatArray, FloatArray]
#: T [s] and K [s²] by which sensors are late, by output; see `_lateness`.
Lateness = Mapping[str, FloatArray]
#: Of every record the motion that was worked out last, for which model and for which parameters of
#: its sensors: hundreds of values of another effect are tried beside the same sensors.
_last: WeakKeyDictionary[SmoothedMotion, tuple[ref[BalanceFunctions], bytes, Motion]] = (
    WeakKeyDictionary()
)


def true_motions(
    model: BalanceFunctions, data: SmoothedMotion, variants: Sequence[FloatArray]
) -> list[Motion]:
    """Return the motions with the effects of sensors inverted, for every variant of θ."""
    if not any_sensor_effect(model.axis.effects):
        return [(data.x, data.dx)] * len(variants)
    sensors, names = model.sensors, model.axis.parameters.names
    shared = [names.index(name) for name in sensors.axis.parameters.names]
    own = [names.index(name) for name in sensors.axis.parameters.names if "." in name]
    # A sensor effect depends on its own parameters alone: equal variants share a motion.
    distinct = {theta[own].tobytes(): theta[shared] for theta in variants}
    if len(distinct) == 1:
        (theta,) = distinct.values()
        return [_single_motion(sensors, data, theta)] * len(variants)
    # Together, so that all are corrected equally often: derivatives are quotients of theirs.
    corrected = _without_sensors(sensors, data, list(distinct.values()))
    known = dict(zip(distinct, corrected, strict=True))
    return [known[theta[own].tobytes()] for theta in variants]


def _single_motion(model: BalanceFunctions, data: SmoothedMotion, theta: FloatArray) -> Motion:
    """Return the motion at θ; the one worked out last where nothing that it depends on differs."""
    names = [name for name in model.axis.parameters.names if "." in name]
    felt = [model.axis.parameters.index(name) for name in (*names, *model.state_dependent)]
    key, last = theta[felt].tobytes(), _last.get(data)
    if last is not None and last[0]() is model and last[1] == key:
        return last[2]
    (motion,) = _without_sensors(model, data, [theta])
    _last[data] = ref(model), key, motion
    return motion


def _without_sensors(
    model: BalanceFunctions, data: SmoothedMotion, variants: Sequence[FloatArray]
) -> list[Motion]:
    motions = [(data.x, data.dx)] * len(variants)
    late: list[Lateness] = []
    hidden = any(effect.hides_motion for effect in model.axis.effects)
    least = UNCHANGED_HIDDEN if hidden else UNCHANGED
    for _ in range(CORRECTIONS):
        states = simulate_effect_states(model, data, variants, motions)
        given = zip(variants, states, motions, strict=True)
        shown = [_shown(model, data, *each) for each in given]
        late = late or [_late_by(model, data, *each) for each in zip(motions, shown, strict=True)]
        last = motions
        motions = [
            _corrected(model, data, *each) for each in zip(motions, shown, late, strict=True)
        ]
        if _distance(model, data, last, motions) < least:
            break
    return motions


def _distance(
    model: BalanceFunctions, data: SmoothedMotion, first: Sequence[Motion], second: Sequence[Motion]
) -> float:
    """Return the largest root mean square difference of motions, in units of the noise."""
    sensors = _of_motion(model)
    rows = [_row(model, name) for name in sensors]
    noise = data.noise[[model.axis.outputs.index(name) for name in sensors]]
    apart = [
        np.sqrt(np.mean((a[rows] - b[rows]) ** 2, axis=1))
        for (a, _), (b, _) in zip(first, second, strict=True)
    ]
    return float(np.max(np.max(apart, axis=0) / np.maximum(noise, 1e-300)))


def simulate_effect_states(
    model: BalanceFunctions,
    data: SmoothedMotion,
    variants: Sequence[FloatArray],
    motions: Sequence[Motion],
) -> list[FloatArray]:
    """Simulate the states of the effects along the motions; (nz, N) for each variant of θ.

    Raises
    ------
    ModelError
        If states jump with commands that the motion no longer holds one by one.
    """
    if not model.n_z:
        return [np.zeros((0, data.N))] * len(variants)
    if model.sampled.any() and not data.commands_kept:
        raise ModelError(
            f"{data.name}: {', '.join(model.axis.sampled_states)} jump with every command, which "
            "must be held over a sample at a uniform clock of less than 2 kHz; decimate a faster "
            "record at the instants of its controller, or leave the effect out"
        )
    constant = np.array([data.dt]), model.constant_values
    u = _now_and_next([data.u])
    driving = {id(motion): _now_and_next(motion) for motion in motions}
    given = [
        (_at_rest(model, data, theta, motion), *driving[id(motion)], *u, *constant, theta)
        for theta, motion in zip(variants, motions, strict=True)
    ]
    return [z[:, : data.N] for z in model.step.accumulate(data.N, given)]


def _at_rest(
    model: BalanceFunctions, data: SmoothedMotion, theta: FloatArray, motion: Motion
) -> FloatArray:
    """Return the states with which a record begins, (nz,)."""
    x, dx = (part[:, :1] for part in motion)
    # The clock: filters take the first samples of a record.
    z: FloatArray = _rest(model, theta, x, dx, data.u[:, 0]) + data.t[0] * model.clocks
    if not model.sampled.any():
        return z
    return np.where(model.sampled, remembered_before(model, data, theta, motion)[:, -1], z)


def remembered_before(
    model: BalanceFunctions, data: SmoothedMotion, theta: FloatArray, motion: Motion
) -> FloatArray:
    """Return the states from a record's first sample to where the motion begins, (nz, n + 1).

    That motion is not known: the axis is taken to stand. Sampled states see the commands alone.
    """
    n = data.u_before.shape[1]
    x, dx = (np.repeat(part[:, :1], n + 1, axis=1) for part in motion)
    u = np.hstack([data.u_before, data.u[:, :1]])
    start = _rest(model, theta, x, dx, u[:, 0])
    constant = np.array([data.dt]), model.constant_values
    driving = (part[:, :n] for part in _now_and_next([x, dx, u]))
    given = (start, *map(np.asfortranarray, driving), *constant, theta)
    return model.step.accumulate(n, [given])[0] if n else start[:, None]


def _rest(
    model: BalanceFunctions, theta: FloatArray, x: FloatArray, dx: FloatArray, u: FloatArray
) -> FloatArray:
    """Return the states at rest at the first of some samples, (nz,)."""
    first = (x[:, 0], dx[:, 0], u, np.zeros(model.n_z), model.constant_values, theta)
    (z,) = call_with_arrays(model.functions["rest"].function, *first)
    return z.ravel()


def _now_and_next(parts: Sequence[FloatArray]) -> list[FloatArray]:
    """Return each of several parts (n, N) at every sample and at the next one."""
    both = []
    for part in parts:
        rows, N = part.shape
        longer = np.empty((rows, N + 1), order="F")
        longer[:, :-1], longer[:, -1] = part, part[:, -1]
        both += [longer[:, :-1], longer[:, 1:]]
    return both


def _shown(
    model: BalanceFunctions, data: SmoothedMotion, theta: FloatArray, z: FloatArray, motion: Motion
) -> dict[str, FloatArray]:
    """Return what sensors show of a motion, by output, unless it is what was measured."""
    given = (*motion, data.u, z, model.constant_values, theta)
    (y,) = model.functions["shown"].evaluate(data.N, *given)
    shown = dict(zip(model.axis.outputs, y, strict=True))
    return {n: shown[n] for n in _of_motion(model) if np.any(shown[n] != data.x[_row(model, n)])}


def _of_motion(model: BalanceFunctions) -> list[str]:
    """Return the sensors of states of the motion; an acceleration is none."""
    return [name for name in model.axis.outputs if name in model.axis.motion_states]


def _row(model: BalanceFunctions, name: str) -> int:
    return model.axis.motion_states.index(name)


def _late_by(
    model: BalanceFunctions, data: SmoothedMotion, motion: Motion, shown: Mapping[str, FloatArray]
) -> Lateness:
    """Return what late sensors are late by, as the first correction shows it."""
    # A long delay taken back to second order is mostly noise: see `Effect.hides_motion`.
    lagging = [e for e in model.axis.effects if e.sensor_delays and not e.hides_motion]
    late = {name for effect in lagging for name in effect.sensors}
    x, _ = motion
    return {
        name: _lateness(x[_row(model, name)] - y, y, *_rates(data, y))
        for name, y in shown.items()
        if name in late
    }


def _corrected(
    model: BalanceFunctions,
    data: SmoothedMotion,
    motion: Motion,
    shown: Mapping[str, FloatArray],
    late: Lateness,
) -> Motion:
    """Return a motion that the sensors show more nearly as it was measured."""
    x, dx = motion
    x_new, dx_new = x.copy(), dx.copy()
    for name, y in shown.items():
        row = _row(model, name)
        shift = data.smooth(data.x[row] - y)
        if name in late:
            shift = _put_ahead(data, shift, *late[name])
        x_new[row] = x[row] + shift
        rate = data.derivative(shift)
        dx_new[row] = dx[row] + rate
        if name == "x":
            v = _row(model, "v")
            x_new[v] = x[v] + rate
            dx_new[v] = dx[v] + data.derivative(rate)
    return x_new, dx_new


def _put_ahead(data: SmoothedMotion, shift: FloatArray, T: float, K: float) -> FloatArray:
    """Return a correction put ahead by what a sensor is late, see `_lateness`.

    Sensors with lags of first and second order are then inverted at once, where corrections as
    they are shown do not settle near a resonance.
    """
    rate, acceleration = _rates(data, shift)
    return np.asarray(shift + T * rate + K * acceleration)


def _rates(data: SmoothedMotion, signal: FloatArray) -> tuple[FloatArray, FloatArray]:
    rate = data.derivative(signal)
    return rate, data.derivative(rate)


def _lateness(
    ahead: FloatArray, shown: FloatArray, rate: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Return T [s] and K [s²] of what a signal is ahead of what is shown, T rate + K acceleration.

    By least squares, beside what a gain or an offset makes of it. K is at most that of a lag with
    ζ = 0.3: anything else is no lag, and a correction by it would grow.
    """
    columns = np.column_stack([rate, acceleration, shown, np.ones_like(shown)])
    scales = np.maximum(np.sqrt(np.sum(columns**2, axis=0)), 1e-300)
    T, K = (np.linalg.lstsq(columns / scales, ahead, rcond=None)[0] / scales)[:2]
    T = max(float(T), 0.0)
    return np.array([T, min(max(float(K), 0.0), STRONGEST_SWING * T**2)])
