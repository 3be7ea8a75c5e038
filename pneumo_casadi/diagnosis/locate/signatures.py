"""Signatures: what one unknown signal alone could explain, an input or a sensor's error.

Three unknown inputs explain whatever three sensors show. One unknown signal explains little but
what it caused: an error of a sensor enters several balances at once, each in its own way, as the
error itself, its rate and its acceleration.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import csr_array, diags_array, hstack, vstack

from pneumo_casadi.diagnosis.locate.model_error import RESIDUAL_ERROR
from pneumo_casadi.diagnosis.locate.nominal_dynamics import evaluate_dynamics, signals_of
from pneumo_casadi.diagnosis.metrics.residual_size import force_row_scale, rows_that_count
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.residuals import linearise_residuals
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion
from pneumo_casadi.metrics import balance_noise, exact_row_gains
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray

#: Distance of the knots of an unknown signal [s]; rows cannot resolve shorter ones.
KNOTS = 0.032
RIDGE = 1e-6

#: Free signals of each hypothesis.
HYPOTHESES: Mapping[str, tuple[str, ...]] = {
    "mass_flow_P": ("mass_flow_P",),
    "mass_flow_N": ("mass_flow_N",),
    "mass_flows": ("mass_flow_P", "mass_flow_N"),
    "force": ("force",),
    "position": ("x",),
    "pressures": ("p_P", "p_N"),
}
#: Hypotheses about sensors.
SENSOR_HYPOTHESES = ("position", "pressures")


@dataclass(frozen=True, slots=True)
class Signatures:
    """How much of the residuals each hypothesis leaves.

    Parameters
    ----------
    before : float
        Mean square of the residuals, in units of noise and a right model's misfit: near one
        where nothing is wrong.
    left : mapping of str to float
        The same with the signals of a hypothesis free, by name (`HYPOTHESES`), per remaining
        degree of freedom.
    """

    before: float
    left: Mapping[str, float]

    @property
    def inputs(self) -> Mapping[str, float]:
        """Of the hypotheses about unknown inputs."""
        return {name: value for name, value in self.left.items() if name not in SENSOR_HYPOTHESES}

    @property
    def sensors(self) -> Mapping[str, float]:
        """Of the hypotheses about sensors."""
        return {name: value for name, value in self.left.items() if name in SENSOR_HYPOTHESES}


def signatures(study: Study, values: Mapping[str, float]) -> Signatures:
    """Try every hypothesis on the held-out records (all, if none is held out).

    Parameters
    ----------
    study : Study
        With its nominal axis.
    values : mapping of str to float
        Nominal parameters as fitted; a refit of them is part of every hypothesis.
    """
    train, held = study.smoothed
    chosen = held or train
    records = [_record_signatures(study, values, data) for data in chosen]
    rows = rows_that_count(study.axis, chosen).sum(axis=1)  # a long record counts by its rows
    before = float(np.average([single.before for single in records], weights=rows))
    left = {
        name: float(np.average([single.left[name] for single in records], weights=rows))
        for name in records[0].left
    }
    return Signatures(before, left)


def _record_signatures(
    study: Study, values: Mapping[str, float], data: SmoothedMotion
) -> Signatures:
    axis = study.axis
    theta = np.array([values[name] for name in axis.parameters.names])
    _, A = evaluate_dynamics(axis, theta, data)
    lin = linearise_residuals(BalanceFunctions(axis), data, theta)
    used = data.used(study.axis)
    scale = residual_floor(axis, values, data)
    r = np.concatenate([lin.r[i][rows] / scale[i] for i, rows in enumerate(used)])
    J = np.concatenate([lin.J[i][rows] / scale[i] for i, rows in enumerate(used)])
    columns = _columns(axis, values, data, A)
    weighted = {
        name: vstack(
            [part[rows] / scale[i] for i, (part, rows) in enumerate(zip(parts, used, strict=True))]
        )
        for name, parts in columns.items()
    }
    left = {
        name: _left(r, J, [weighted[signal] for signal in signals])
        for name, signals in HYPOTHESES.items()
        if set(signals) <= columns.keys()
    }
    return Signatures(_left(r, J, []), left)


def residual_floor(axis: Axis, values: Mapping[str, float], data: SmoothedMotion) -> FloatArray:
    """Return what noise and a right model's misfit leave in each balance [Pa/s, Pa/s, N].

    Of a force-driven axis [m/s²], as its residuals are.
    """
    signal = row_signals(axis, values, data)
    return np.sqrt(noise_variance(axis, values, data) + (RESIDUAL_ERROR * signal) ** 2)


def row_signals(axis: Axis, values: Mapping[str, float], data: SmoothedMotion) -> FloatArray:
    """Return the root mean square of what each balance drives, ṗ or force [Pa/s, Pa/s, N].

    Of a force-driven axis [m/s²], as its residuals are.
    """
    theta = np.array([values[name] for name in axis.parameters.names])
    rates = [np.std(data.dx[axis.motion_states.index(name)]) for name in axis.outputs[:-1]]
    force = signals_of(axis, theta, data)[-1] / force_row_scale(axis.kind, values["M"])
    return np.array([*rates, force])


def noise_variance(axis: Axis, values: Mapping[str, float], data: SmoothedMotion) -> FloatArray:
    """Return the variance that the sensors' noise leaves in a row of each balance."""
    theta = np.array([values[name] for name in axis.parameters.names])
    _, A = evaluate_dynamics(axis, theta, data)
    v = axis.motion_states.index("v")
    slopes = [
        float(np.sqrt(np.mean(A[axis.motion_states.index(name), v] ** 2)))
        for name in axis.outputs[:-1]
    ]
    mass = values["M"] / force_row_scale(axis.kind, values["M"])
    noise = balance_noise(data, exact_row_gains(data), mass, velocity_slopes=slopes)
    return noise**2


def _columns(
    axis: Axis, values: Mapping[str, float], data: SmoothedMotion, A: FloatArray
) -> dict[str, list[Any]]:
    """Return the rows of every balance for each signal's spline, by name of the signal.

    Along a measured motion x + e a residual f - ẋ grows by A e - ė, and the velocity's error is ė.
    """
    names = axis.motion_states
    spline = _spline(data.N, max(1, round(KNOTS / data.dt)))
    half = np.full(data.N - 1, 0.5 / data.dt)
    step = csr_array(diags_array(half, offsets=1) - diags_array(half, offsets=-1))
    S = [spline, step @ spline, step @ (step @ spline)]
    mass = values["M"] / force_row_scale(axis.kind, values["M"])
    scale = [*(1.0 for _ in axis.outputs[:-1]), mass]
    states = [*axis.outputs[:-1], "v"]
    columns: dict[str, list[Any]] = {}
    for sensor in axis.outputs:
        parts = []
        for own, size in zip(states, scale, strict=True):
            a = A[names.index(own)] * size
            total = diags_array(a[names.index(sensor)]) @ S[0]
            if sensor == "x":
                total = total + diags_array(a[names.index("v")]) @ S[1]
            if own == sensor:
                total = total - S[1]
            if own == "v" and sensor == "x":
                total = total - size * S[2]
            parts.append(csr_array(data.weak @ total))
        columns[sensor] = parts
    rows = csr_array(data.weak @ spline)
    for i, equation in enumerate(axis.equations):
        columns[equation] = [rows if i == j else 0 * rows for j in range(len(axis.equations))]
    return columns


def _spline(N: int, every: int) -> Any:
    """Return cubic B-splines on even knots at N samples, (N, K)."""
    knots = (np.arange(N // every + 7) - 3.0) * every
    at = np.clip(np.arange(N, dtype=float), knots[3], knots[-4] - 1e-9)
    return csr_array(BSpline.design_matrix(at, knots, 3))


def _left(r: FloatArray, J: FloatArray, free: Sequence[Any]) -> float:
    """Return the mean square that parameters J and free signals leave, per degree of freedom."""
    J = J / np.maximum(np.linalg.norm(J, axis=0), 1e-300)
    if not free:
        e = r - J @ np.linalg.lstsq(J, r, rcond=1e-9)[0]
        return float(e @ e / (r.size - J.shape[1]))
    # Knots of all signals in turns, so that the normal equations are banded.
    parts = [part * (1 / np.sqrt(part.multiply(part).sum() / part.shape[1])) for part in free]
    K = parts[0].shape[1]
    order = np.arange(len(parts) * K).reshape(len(parts), K).T.ravel()
    G = csr_array(hstack(parts))[:, order]
    H = (G.T @ G + RIDGE * diags_array(np.ones(G.shape[1]))).tocoo()
    width = int(np.max(H.col - H.row))
    band = np.zeros((width + 1, G.shape[1]))
    upper = H.col >= H.row
    band[width + H.row[upper] - H.col[upper], H.col[upper]] = H.data[upper]
    factor = cholesky_banded(band)
    both = np.column_stack([r, J])
    both = both - G @ cho_solve_banded((factor, False), G.T @ both)
    e, rest = both[:, 0], both[:, 1:]
    e = e - rest @ np.linalg.lstsq(rest, e, rcond=1e-9)[0]
    return float(e @ e / max(r.size - G.shape[1] - J.shape[1], 1))
