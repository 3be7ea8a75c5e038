"""The estimation problem that every tool is given, in plain numbers.

States x = (p_P, p_N, x, v), inputs u held over each sampling period, and

    ṗ_P = (q_m(u_P, p_P) - X_s3 p_P v) / (X_s1 + X_s2 x)
    ṗ_N = (q_m(u_N, p_N) + X_s6 p_N v) / (X_s4 - X_s5 x)
    v̇   = (S_P p_P - S_N p_N - (S_P - S_N) p_ext - F_f(v)) / M
    F_f = f_v v + F_c⁺ (1 + s)/2 - F_c⁻ (1 - s)/2,    s = tanh(v / v_s).

Ten parameters and the initial state minimise ½ Σ_k Σ_i ((y_ik - h_i(x_k)) / σ_i)², where sample
y_k belongs to x_k and u_k acts from x_k to x_{k+1}. The flow map is known; v_s is known.

Larger problems cut the record into windows, each with an initial state of its own, or free the
Chebyshev coefficients of the flow polynomials too; the metered points of the flow map then
add ½ Σ ((q_m(u, p) - q_m,measured) / σ_q)² to the cost.
"""

import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

#: Sizes of the states by which tools that scale divide them [Pa, Pa, m, m/s].
STATE_SCALES = np.array([1e5, 1e5, 0.1, 0.5])
#: States that are measured: p_P, p_N, x.
N_OUTPUTS = 3


@dataclass(frozen=True)
class FlowPoints:
    """Metered flows q_m [kg/s] at u [V] and p [Pa], and the standard deviation of one."""

    u: np.ndarray
    p: np.ndarray
    q_m: np.ndarray
    sigma: float


@dataclass(frozen=True)
class Estimation:
    """Data, constants and start of the problem.

    Parameters
    ----------
    names : tuple of str
        Free parameters, in the order X_s1 ... X_s6, M, f_v, F_c_plus, F_c_minus; then, where they
        are free, the Chebyshev coefficients of φ, ψ⁺ and ψ⁻.
    start, truth : (10,) array
        Where every tool starts, and the values that made the data.
    dt : float
        Sampling period [s].
    u : (N, 2) array
        Inputs; u[k] holds from sample k to sample k + 1 [V].
    y : (N, 3) array
        Measured p_P, p_N, x.
    states : (N, 4) array
        Smoothed measurements: the start of the states.
    sigma : (3,) array
        Noise of one sample.
    phi, psi_plus, psi_minus : (n,) array
        Flow polynomials in z, lowest power first; z = ±1 at the ends of `p_range`.
    p_range : tuple of float
        [Pa]; the records stay well inside.
    constants : dict of str to float
        S_P, S_N [m²], p_ext [Pa] and v_s [m/s].
    own : bytes
        The same start and data as an axis, a recording and a flow map (or None) of this package,
        pickled.
    windows : int
        Windows of equal length with an initial state each; `y` holds them one after another.
    steps : int
        Runge-Kutta steps of order four a sample, for tools that take such.
    scales : (n,) array
        Sizes of the parameters.
    flow_map : FlowPoints or None
        Metered points, where the flow coefficients are free.
    """

    names: tuple[str, ...]
    start: np.ndarray
    truth: np.ndarray
    dt: float
    u: np.ndarray
    y: np.ndarray
    states: np.ndarray
    sigma: np.ndarray
    phi: np.ndarray
    psi_plus: np.ndarray
    psi_minus: np.ndarray
    p_range: tuple[float, float]
    constants: dict[str, float]
    own: bytes
    windows: int
    steps: int
    scales: np.ndarray
    flow_map: "FlowPoints | None" = None

    @property
    def N(self) -> int:
        """Number of samples."""
        return len(self.y)

    @cached_property
    def flow_coefficients(self) -> np.ndarray:
        """Powers of z in q_m at every sample's held inputs, shape (N, 2, n)."""
        return held_coefficients(self.u, self.phi, self.psi_plus, self.psi_minus)

    def z(self, p: Any) -> Any:
        """Return the scaled pressure."""
        low, high = self.p_range
        return (p - (low + high) / 2) * (2 / (high - low))

    def flow(self, opening_plus: Any, opening_minus: Any, p: Any) -> Any:
        """Return q_m [kg/s] at max(u, 0) and min(u, 0), in whatever arithmetic."""
        z = self.z(p)
        plus, minus = polynomial(self.psi_plus, z), polynomial(self.psi_minus, z)
        return polynomial(self.phi, z) + plus * opening_plus + minus * opening_minus

    def rates(self, x: Sequence[Any], q: Sequence[Any], theta: Sequence[Any], tanh: Any) -> list:
        """Return the four derivatives from states, the two flows and parameters, in SI."""
        c = self.constants
        p_P, p_N, position, v = x
        X_1, X_2, X_3, X_4, X_5, X_6, M, f_v, F_plus, F_minus = theta
        direction = tanh(v * (1 / c["v_s"]))
        friction = f_v * v + F_plus * (1 + direction) / 2 - F_minus * (1 - direction) / 2
        effort = c["S_P"] * p_P - c["S_N"] * p_N - (c["S_P"] - c["S_N"]) * c["p_ext"]
        return [
            (q[0] - X_3 * p_P * v) / (X_1 + X_2 * position),
            (q[1] + X_6 * p_N * v) / (X_4 - X_5 * position),
            v,
            (effort - friction) / M,
        ]

    def scaled_rates(
        self,
        x: Sequence[Any],
        q_of: Callable,
        theta: Sequence[Any],
        tanh: Any,
        scales: np.ndarray = STATE_SCALES,
    ) -> list:
        """Return the derivatives of x / `scales` from θ / `start`.

        ``q_of(i, p)`` gives the flow of valve i at the pressure p.
        """
        sizes = scales.tolist()
        states = [value * size for value, size in zip(x, sizes, strict=True)]
        values = [value * size for value, size in zip(theta, self.start.tolist(), strict=True)]
        q = [q_of(i, states[i]) for i in range(2)]
        result = self.rates(states, q, values, tanh)
        return [rate * (1 / size) for rate, size in zip(result, sizes, strict=True)]

    @property
    def scaled_states(self) -> np.ndarray:
        """Start of the states over their scales, shape (N, 4)."""
        return self.states / STATE_SCALES

    @property
    def scaled_y(self) -> np.ndarray:
        """Measurements over the scales of the states, shape (N, 3)."""
        return self.y / STATE_SCALES[:N_OUTPUTS]

    @property
    def weights(self) -> np.ndarray:
        """Scales of the outputs over their noise, shape (3,)."""
        return STATE_SCALES[:N_OUTPUTS] / self.sigma

    @property
    def starts(self) -> np.ndarray:
        """First state of every window to start from, shape (windows, 4)."""
        return self.states[:: self.N // self.windows]

    def write(self, path: Path) -> None:
        """Write the problem to a file of the benchmark's own."""
        path.write_bytes(pickle.dumps(self))

    @classmethod
    def read(cls, path: Path) -> "Estimation":
        """Read what `write` wrote."""
        content = pickle.loads(path.read_bytes())
        if not isinstance(content, cls):
            raise TypeError(f"{path} holds no estimation problem")
        return content


@dataclass(frozen=True)
class Answer:
    """What a tool found.

    Parameters
    ----------
    theta, x_0 : sequence of float
        Parameters and the initial state of every window, flat, in SI.
    objective : float
        ½ Σ ((y - ŷ)/σ)² as the tool itself sees it, on its own grid.
    status : str
        As the tool says.
    iterations : int or None
        As the tool counts them.
    solve_s : float or None
        Time of solving where building and solving are one call [s]; else it is measured.
    """

    theta: Sequence[float]
    x_0: Sequence[float]
    objective: float
    status: str
    iterations: int | None = None
    solve_s: float | None = None


def held_coefficients(
    u: np.ndarray, phi: np.ndarray, psi_plus: np.ndarray, psi_minus: np.ndarray
) -> np.ndarray:
    """Return the coefficients of q_m in the pressure at given inputs, shape (*u.shape, n)."""
    n = max(map(len, (phi, psi_plus, psi_minus)))
    zero, plus, minus = (np.pad(c, (0, n - len(c))) for c in (phi, psi_plus, psi_minus))
    opening = u[..., None]
    return zero + plus * np.maximum(opening, 0.0) + minus * np.minimum(opening, 0.0)


def polynomial(coefficients: Sequence[Any], z: Any) -> Any:
    """Return Σ c_j z^j by Horner's rule, in whatever arithmetic."""
    result = coefficients[-1]
    for c in coefficients[-2::-1]:
        result = result * z + c
    return result
