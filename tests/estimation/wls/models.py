"""Eq. 7 typed out by hand, and records that obey it exactly: independent of the package's model."""

import casadi as ca
import numpy as np

from pneumo_casadi.data import InputHold, Recording
from pneumo_casadi.parameters import Parameter, Parameters

FS = 1e3
TRUE = {
    "X_s1": 3.49e-9,
    "X_s2": 9.95e-9,
    "X_s3": 1.04e-8,
    "X_s4": 1.78e-9,
    "X_s5": 7.00e-9,
    "X_s6": 7.17e-9,
    "M": 16.9,
    "f_v": 11.0,
    "F_c_plus": 10.3,
    "F_c_minus": 23.8,
}


class Eq7:
    """The regressor of eq. 7; the inputs are its left side, both mass flows and the effort."""

    equations = ("mass_flow_P", "mass_flow_N", "force")
    motion_states = ("p_P", "p_N", "x", "v")
    inputs = ("u_P", "u_N", "F")
    regressor_names = tuple(TRUE)
    parameters = Parameters([Parameter(name, value, "SI") for name, value in TRUE.items()])

    def regressor(self, names=None):
        x, dx, u = ca.SX.sym("x", 4), ca.SX.sym("dx", 4), ca.SX.sym("u", 3)
        p_P, p_N, q, v = (x[i] for i in range(4))
        f, g = (1 + ca.sign(v)) / 2, (1 - ca.sign(v)) / 2
        W = ca.SX.zeros(3, 10)
        W[0, :3] = ca.horzcat(dx[0], q * dx[0], v * p_P)
        W[1, 3:6] = ca.horzcat(dx[1], -q * dx[1], -v * p_N)
        W[2, 6:] = ca.horzcat(dx[3], v, f, -g)
        chosen = [self.regressor_names.index(name) for name in names or self.regressor_names]
        return ca.Function("eq7", [x, dx, u], [u, ca.densify(W[:, chosen])])


def smooth_record(seed, N=20_000, noise=0.0):
    """A record that obeys eq. 7 with TRUE: analytic motion and pressures, the rest follows."""
    rng = np.random.default_rng(seed)
    t = np.arange(N) / FS
    x, v, a = _sines(rng, t, 0.05)
    p_P, dp_P, _ = _sines(rng, t, 8e4)
    p_N, dp_N, _ = _sines(rng, t, 6e4)
    p_P, p_N = p_P + 4e5, p_N + 5e5
    P = TRUE
    left = {
        "u_P": (P["X_s1"] + P["X_s2"] * x) * dp_P + P["X_s3"] * v * p_P,
        "u_N": (P["X_s4"] - P["X_s5"] * x) * dp_N - P["X_s6"] * v * p_N,
        "F": P["M"] * a + P["f_v"] * v + np.where(v > 0, P["F_c_plus"], -P["F_c_minus"]),
    }
    left = {name: y + rng.normal(0, noise * np.std(y), N) for name, y in left.items()}
    channels = {**left, "p_P": p_P, "p_N": p_N, "x": x}
    return Recording(t, channels, f"smooth{seed}", "made", InputHold.LINEAR)


def record_with_rests(seed=1, rest=4000):
    """The same with a rest at a reversal, where friction holds the axis against 8 N."""
    rec = smooth_record(seed)
    middle = np.arange(rec.N // 2 - 1000, rec.N // 2 + 1000)
    turn = int(middle[np.argmin(np.abs(np.gradient(rec["x"])[middle]))])
    rows = np.concatenate([np.arange(turn), np.full(rest, turn), np.arange(turn, rec.N)])
    channels = {name: rec[name][rows] for name in rec.names}
    channels["F"][turn : turn + rest] = 8.0
    noise = np.random.default_rng(0).normal(0, 2e-6, rows.size)
    channels["x"] = channels["x"] + noise
    return Recording(np.arange(rows.size) / FS, channels, "rests", "made", InputHold.LINEAR)


def _sines(rng, t, size):
    """Sum of sines with two derivatives."""
    out = np.zeros((3, t.size))
    for frequency in (0.31, 0.73, 1.3, 1.9):
        w, phase = 2 * np.pi * frequency, rng.uniform(0, 2 * np.pi)
        for order in range(3):
            out[order] += size / 3 * w**order * np.sin(w * t + phase + order * np.pi / 2)
    return out
