"""Unknown inputs of the balances: weak-constraint smoothing of the nominal axis.

Each balance has an unknown input, w_P and w_N [kg/s] into the chambers and w_F [N]
onto the piston. States and inputs are estimated together from the measurements; where the model
is right, the inputs stay within their bands about zero.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.diagnosis.locate.input_smoother import NODE, discretise, smooth_inputs
from pneumo_casadi.diagnosis.locate.nominal_dynamics import evaluate_dynamics, signals_of
from pneumo_casadi.diagnosis.locate.random_walk import random_walk_stds
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.estimation.equation_error.smoothed_motion import (
    NOISE_MULTIPLE,
    SLOW,
    SmoothedMotion,
)
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.presentation import Brief


@dataclass(frozen=True, eq=False, repr=False)
class UnknownInputs(Brief):
    """Unknown inputs of one record, with standard deviations.

    Parameters
    ----------
    t : (K,) array
        Middles of the intervals between nodes [s].
    w, std : (ne, K) array
        Inputs and their standard deviations [kg/s, kg/s, N], in the order of ``equations``.
    states : (nx, K) array
        Smoothed nominal states at the nodes, half an interval before `t`.
    counts : (ne, K) array of bool
        Nodes that carry information: while the axis sticks, static friction takes any force.
    signal : (ne,) array
        Root mean square of the balance's own terms: valve flow, or force of drive [kg/s, N].
    walk_std : (ne,) array
        Standard deviation of an input's change in one second, estimated from the data.
    equations : tuple of str
        Names of the balances.
    """

    t: FloatArray
    w: FloatArray
    std: FloatArray
    states: FloatArray
    counts: NDArray[np.bool_]
    signal: FloatArray
    walk_std: FloatArray
    equations: tuple[str, ...]

    @property
    def energy(self) -> FloatArray:
        """Mean square of each input above its band, over that of the balance's signal, (ne,)."""
        above = np.maximum(self.w**2 - self.std**2, 0.0) * self.counts
        mean = above.sum(axis=1) / np.maximum(self.counts.sum(axis=1), 1)
        return np.asarray(mean / self.signal**2)


def estimate_unknown_inputs(study: Study, nominal: FittedModel) -> tuple[UnknownInputs, ...]:
    """Estimate the unknown inputs of the records held out, or of all that there are."""
    train, held = study.smoothed
    return tuple(unknown_inputs(study.axis, nominal.values, data) for data in held or train)


def unknown_inputs(axis: Axis, values: Mapping[str, float], data: SmoothedMotion) -> UnknownInputs:
    """Estimate the unknown inputs of one record.

    Parameters
    ----------
    axis : Axis
        Nominal.
    values : mapping of str to float
        Its parameters as fitted.
    data : SmoothedMotion
        The record.

    Returns
    -------
    UnknownInputs

    Notes
    -----
    Minimises Σ (y - h(x))²/R + Σ (w_{k+1} - w_k)²/(q² h) subject to the dynamics
    ẋ = f(x, u) + B w from node to node: one Gauss-Newton step from the smoothed measurements,
    which lie some standard deviations of noise from the solution, solved by a Rauch-Tung-Striebel
    smoother (Särkkä 2013, Bayesian Filtering and Smoothing, ch. 8). The step's defects are the
    balances' residuals along the measured motion. Each walk q maximises Whittle's likelihood of
    its balance's residuals: a walk on top of differenced measurement noise.
    """
    theta = np.array([values[name] for name in axis.parameters.names])
    every = max(1, round(NODE / data.dt))
    h = every * data.dt
    f, A = evaluate_dynamics(axis, theta, data)
    if axis.kind.measured_inputs:  # filtered like the motion
        f = np.stack([data.smooth(row) for row in f])
    K = data.N // every
    nodes = data.x[:, : K * every : every]
    rate, slope = (_blocks(part, every, K) for part in (f, A.reshape(-1, data.N)))
    defect = h * rate[:, :-1] - np.diff(nodes, axis=1)
    B = _input_columns(axis, values, _blocks(data.x, every, K))
    moving = ~_slow_nodes(axis, data, every, K)
    R = data.noise**2 * _gain(data)
    walk_std = random_walk_stds(axis, defect, B, R, moving, h)
    F, G = discretise(slope, B, h)
    stick = (abs(values["F_c_plus"]) + abs(values["F_c_minus"])) / 2 / values["M"] * h
    w, std, xi = smooth_inputs(axis, F, G, defect, R, walk_std**2 * h, ~moving, stick)
    counts = np.ones((len(axis.equations), K), dtype=bool)
    counts[axis.equations.index("force")] = moving
    signal = signals_of(axis, theta, data)
    # An input acts from its node to the next: it belongs to the middle.
    t = data.t[: K * every : every] + h / 2
    return UnknownInputs(t, w, std, nodes + xi, counts, signal, walk_std, axis.equations)


def _blocks(values: FloatArray, every: int, K: int) -> FloatArray:
    """Average columns over the intervals from node to node, (rows, K)."""
    whole = values[:, : K * every]
    return np.asarray(whole.reshape(len(values), K, every).mean(axis=2))


def _input_columns(axis: Axis, values: Mapping[str, float], x: FloatArray) -> FloatArray:
    """Return what a unit of each input adds to ẋ, (K, nx, ne)."""
    names = axis.motion_states
    B = np.zeros((x.shape[1], len(names), len(axis.equations)))
    position = x[names.index("x")]
    for i, equation in enumerate(axis.equations):
        if equation == "force":
            B[:, names.index("v"), i] = 1 / values["M"]
        elif equation == "mass_flow_P":
            B[:, names.index("p_P"), i] = 1 / (values["X_s1"] + values["X_s2"] * position)
        else:
            B[:, names.index("p_N"), i] = 1 / (values["X_s4"] - values["X_s5"] * position)
    return B


def _slow_nodes(axis: Axis, data: SmoothedMotion, every: int, K: int) -> NDArray[np.bool_]:
    limit = max(SLOW, NOISE_MULTIPLE * data.velocity_noise)
    slow = np.abs(data.x[axis.motion_states.index("v")]) < limit
    near = np.asarray(slow[: K * every].reshape(K, every).any(axis=1))
    wide: NDArray[np.bool_] = np.convolve(near, np.ones(5), mode="same") > 0
    return wide


def _gain(data: SmoothedMotion) -> float:
    """Return which share of a white noise's variance the filter leaves."""
    impulse = np.zeros(data.N)
    impulse[data.N // 2] = 1.0
    return float(np.sum(data.smooth(impulse) ** 2))
