"""Unknown inputs of the balances: weak-constraint smoothing of the nominal axis.

Each balance is given an input that nobody knows, w_P and w_N [kg/s] into the chambers and w_F [N]
onto the piston. States and inputs are estimated together from the measurements; where the model
is right, the inputs stay within their bands about zero.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from pneumo_casadi.diagnosis.prepare.study import FittedModel, Study
from pneumo_casadi.estimation.equation_error.smoothed_motion import (
    NOISE_MULTIPLE,
    SLOW,
    SmoothedMotion,
)
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray

#: Distance of the nodes [s]; the filter of the measurements leaves their noise white there.
NODE = 8e-3
#: Range of the walks: share of a balance's signal that an input may change in one second.
WALK = (1e-4, 1e2)


@dataclass(frozen=True, eq=False)
class UnknownInputs:
    """What the balances of one record lack, with bands.

    Parameters
    ----------
    t : (K,) array
        Middles of the intervals between nodes [s].
    w, std : (ne, K) array
        Inputs and their standard deviations [kg/s, kg/s, N], in the order of ``equations``.
    states : (nx, K) array
        Smoothed nominal states at the nodes, half an interval before `t`.
    counts : (ne, K) array of bool
        Nodes that tell: while the axis sticks, static friction takes any force.
    signal : (ne,) array
        Root mean square of the balance's own terms: valve flow, or force of drive [kg/s, N].
    walk : (ne,) array
        Standard deviation of an input's change in one second, as the data ask for it.
    equations : tuple of str
        Names of the balances.
    """

    t: FloatArray
    w: FloatArray
    std: FloatArray
    states: FloatArray
    counts: NDArray[np.bool_]
    signal: FloatArray
    walk: FloatArray
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
    walk = _random_walk_stds(axis, defect, B, R, moving, h)
    F, G = _discrete(slope, B, h)
    stick = (abs(values["F_c_plus"]) + abs(values["F_c_minus"])) / 2 / values["M"] * h
    w, std, xi = _smooth(axis, F, G, defect, R, walk**2 * h, ~moving, stick)
    counts = np.ones((len(axis.equations), K), dtype=bool)
    counts[axis.equations.index("force")] = moving
    signal = signals_of(axis, theta, data)
    # An input acts from its node to the next: it belongs to the middle.
    t = data.t[: K * every : every] + h / 2
    return UnknownInputs(t, w, std, nodes + xi, counts, signal, walk, axis.equations)


def evaluate_dynamics(
    axis: Axis, theta: FloatArray, data: SmoothedMotion
) -> tuple[FloatArray, FloatArray]:
    """Return f (nx, N) and ∂f/∂x (nx, nx, N) of the nominal axis along the motion."""
    sym = axis.symbol.sym
    x, u = sym("x", len(axis.states)), sym("u", len(axis.inputs))
    f = axis.rhs(x, u, theta)
    both = ca.Function("along", [x, u], [f, ca.densify(ca.vec(ca.jacobian(f, x)))])
    rates, slopes = both.map(data.N)(data.x, data.u)
    nx = len(axis.states)
    return np.asarray(rates), np.asarray(slopes).reshape(nx, nx, data.N).transpose(1, 0, 2)


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


def _random_walk_stds(
    axis: Axis,
    defect: FloatArray,
    B: FloatArray,
    R: FloatArray,
    moving: NDArray[np.bool_],
    h: float,
) -> FloatArray:
    """Return the walk of each input that makes its balance's residuals most likely, (ne,)."""
    names = axis.motion_states
    stds = []
    for i, equation in enumerate(axis.equations):
        state = {"force": "v", "mass_flow_P": "p_P", "mass_flow_N": "p_N"}[equation]
        unit = B[:-1, names.index(state), i]
        r = defect[names.index(state)] / h / unit
        if equation == "force":
            r = np.where(moving[:-1], r, 0.0)
        measured = "x" if equation == "force" else state
        size = float(np.mean(1 / unit)) ** 2 * R[axis.outputs.index(measured)]
        stds.append(_random_walk_std(r, size, 4 if equation == "force" else 2, h))
    return np.array(stds)


def _random_walk_std(r: FloatArray, noise: float, power: int, h: float) -> float:
    """Return the walk [1/√s] of residuals r with noise that was differenced once or twice."""
    P = np.abs(np.fft.rfft(r - r.mean())[1:]) ** 2 / r.size
    half = 2 * np.sin(np.pi * np.arange(1, P.size + 1) / r.size)
    floor = noise * (half / h) ** power
    shape = h / half**2

    def cost(log_q: float) -> float:
        S = np.exp(2 * log_q) * shape + floor
        return float(np.sum(np.log(S) + P / S))

    size = np.sqrt(np.mean(r**2)) + 1e-300
    low, high = np.log(WALK[0] * size), np.log(WALK[1] * size)
    return float(np.exp(minimize_scalar(cost, bounds=(low, high), method="bounded").x))


def _discrete(slope: FloatArray, B: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
    """Return transition matrices (K, nx, nx) and input columns (K, nx, ne) of one interval."""
    K, nx, ne = B.shape
    A = slope.T.reshape(K, nx, nx)
    M = np.zeros((K, nx + ne, nx + ne))
    M[:, :nx, :nx], M[:, :nx, nx:] = h * A, h * B
    # Scaling and squaring: friction about standstill is stiff.
    squarings = max(0, int(np.ceil(np.log2(max(np.abs(h * A).sum(axis=2).max(), 1e-9)))) + 3)
    M = M / 2.0**squarings
    E = term = np.broadcast_to(np.eye(nx + ne), M.shape)
    for order in range(1, 7):
        term = term @ M / order
        E = E + term
    for _ in range(squarings):
        E = E @ E
    return E[:, :nx, :nx], E[:, :nx, nx:]


def _smooth(
    axis: Axis,
    F: FloatArray,
    G: FloatArray,
    defect: FloatArray,
    R: FloatArray,
    Q: FloatArray,
    sticks: NDArray[np.bool_],
    stick: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Smooth deviations ξ and inputs w; return w, its deviation, and ξ."""
    K, nx, ne = G.shape
    n = nx + ne
    scale = _scales(axis, R, G, Q)
    T = np.zeros((K, n, n))
    T[:, :nx, :nx], T[:, :nx, nx:], T[:, nx:, nx:] = F, G, np.eye(ne)
    T = T * scale / scale[:, None]
    d = np.zeros((K - 1, n))
    d[:, :nx] = defect.T
    d /= scale
    V = np.zeros((K, n))
    V[:, nx:] = Q
    # While the axis sticks, friction is whatever keeps it there.
    V[sticks, axis.motion_states.index("v")] = stick**2
    V /= scale**2
    H = np.zeros((len(axis.outputs), n))
    for row, name in enumerate(axis.outputs):
        H[row, axis.motion_states.index(name)] = 1.0
    H = H * scale / np.sqrt(R)[:, None]
    z, P, before, P_before = _forward(T, d, V, H)
    for k in range(K - 2, -1, -1):
        gain = np.linalg.solve(P_before[k + 1], T[k] @ P[k]).T
        z[k] += gain @ (z[k + 1] - before[k + 1])
        P[k] += gain @ (P[k + 1] - P_before[k + 1]) @ gain.T
    variance = np.maximum(np.diagonal(P, axis1=1, axis2=2), 0.0).T * scale[:, None] ** 2
    z = z.T * scale[:, None]
    return z[nx:], np.sqrt(variance[nx:]), z[:nx]


def _forward(
    T: FloatArray, d: FloatArray, V: FloatArray, H: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Filter; all measurements of the deviations are zero with unit variance."""
    K, n, _ = T.shape
    z, before = np.zeros((K, n)), np.zeros((K, n))
    P, P_before = np.zeros((K, n, n)), np.zeros((K, n, n))
    mean, covariance = np.zeros(n), np.eye(n) * 1e4
    unit = np.eye(len(H))
    for k in range(K):
        if k:
            mean = T[k - 1] @ mean + d[k - 1]
            covariance = T[k - 1] @ covariance @ T[k - 1].T
            covariance[np.diag_indices(n)] += V[k - 1]
        before[k], P_before[k] = mean, covariance
        PH = covariance @ H.T
        gain = np.linalg.solve(H @ PH + unit, PH.T).T
        mean = mean - gain @ (H @ mean)
        covariance = covariance - gain @ PH.T
        covariance = (covariance + covariance.T) / 2
        z[k], P[k] = mean, covariance
    return z, P, before, P_before


def _scales(axis: Axis, R: FloatArray, G: FloatArray, Q: FloatArray) -> FloatArray:
    """Return sizes of ξ and w, so that all covariances are near one, (nx + ne,)."""
    names = axis.motion_states
    size = np.ones(len(names))
    for row, name in enumerate(axis.outputs):
        size[names.index(name)] = np.sqrt(R[row])
    size[names.index("v")] = size[names.index("x")] / NODE
    return np.concatenate([size, 10 * np.sqrt(Q)])


def signals_of(axis: Axis, theta: FloatArray, data: SmoothedMotion) -> FloatArray:
    """Return the root mean square of each balance's own terms [kg/s, kg/s, N]."""
    rows = []
    if axis.kind.gas_chambers:
        rows += list(np.asarray(axis.valve_flow.map(data.N)(data.x, data.u, theta)))
    rows.append(axis.driving_force(data.x, data.u))
    return np.asarray(np.sqrt(np.mean(np.square(rows), axis=1)))
