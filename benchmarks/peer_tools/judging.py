"""What an answer is worth: its cost, simulated anew by fine steps without any tool's code."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial, chebyshev

from peer_tools.estimation import N_OUTPUTS, Estimation, held_coefficients, polynomial

#: Longest Runge-Kutta step of order four [s].
FINE = 1.25e-4
#: Parameters of the axis; those that follow belong to the flow map.
MECHANICAL = 10


def cost(problem: Estimation, theta: Sequence[float], x_0: Sequence[float]) -> float:
    """Return ½ Σ ((y - ŷ)/σ)², that of the flow map included where it is free."""
    values = [float(value) for value in theta]
    branches = flow_branches(problem, values)
    starts = np.reshape(np.asarray(x_0, dtype=float), (problem.windows, -1))
    # One trajectory in plain numbers, many side by side as arrays.
    alone = problem.windows == 1
    x: list[Any] = starts[0].tolist() if alone else list(starts.T)
    with np.errstate(all="ignore"):  # what diverges is infinitely bad
        total = _simulate(problem, values[:MECHANICAL], branches, x, alone) / 2
    total += map_cost(problem, np.asarray(values[MECHANICAL:]))
    return total if math.isfinite(total) else math.inf


def flow_branches(problem: Estimation, theta: Sequence[float]) -> list[np.ndarray]:
    """Return φ, ψ⁺ and ψ⁻ in powers of z, with coefficients of θ where they are free."""
    known = [problem.phi, problem.psi_plus, problem.psi_minus]
    if len(theta) == MECHANICAL:
        return known
    cuts = np.cumsum([len(c) for c in known])[:-1]
    parts = np.split(np.asarray(theta[MECHANICAL:]), cuts)
    return [Chebyshev(part).convert(kind=Polynomial).coef for part in parts]


def map_cost(problem: Estimation, coefficients: np.ndarray) -> float:
    """Return the metered points' part of the cost; zero where the flow is known."""
    if problem.flow_map is None:
        return 0.0
    e = map_jacobian(problem) @ coefficients - problem.flow_map.q_m / problem.flow_map.sigma
    return 0.5 * float(e @ e)


def map_jacobian(problem: Estimation) -> np.ndarray:
    """Return ∂(q_m/σ)/∂(Chebyshev coefficients) of the metered points: q_m is linear in them."""
    points = problem.flow_map
    if points is None:
        raise ValueError("the flow map of this problem is known")
    lengths = [len(c) for c in (problem.phi, problem.psi_plus, problem.psi_minus)]
    T = chebyshev.chebvander(problem.z(points.p), max(lengths) - 1)
    openings = (np.ones_like(points.u), np.maximum(points.u, 0.0), np.minimum(points.u, 0.0))
    columns = [T[:, :n] * o[:, None] for n, o in zip(lengths, openings, strict=True)]
    return np.hstack(columns) / points.sigma


def _simulate(
    problem: Estimation, theta: list[float], branches: list[np.ndarray], x: list[Any], alone: bool
) -> float:
    """Return Σ ((y - ŷ)/σ)² of all windows side by side."""
    steps = max(1, round(problem.dt / FINE))
    h = problem.dt / steps
    n = problem.N // problem.windows
    held = held_coefficients(problem.u, *branches)
    tanh: Any = math.tanh if alone else np.tanh
    inputs: list[Any]
    if alone:
        inputs, measured = held.tolist(), problem.y.tolist()
    else:  # time first, windows last
        inputs = list(held.reshape(-1, n, *held.shape[1:]).transpose(1, 2, 3, 0))
        measured = problem.y.reshape(-1, n, N_OUTPUTS).transpose(1, 2, 0)
    sigma = problem.sigma.tolist()

    def f(at: list[Any], coefficients: Any) -> list[Any]:
        q = [polynomial(coefficients[i], problem.z(at[i])) for i in range(2)]
        return problem.rates(at, q, theta, tanh)

    def ahead(at: list[Any], rate: list[Any], span: float) -> list[Any]:
        return [a + span * b for a, b in zip(at, rate, strict=True)]

    total: Any = 0.0
    for k in range(n):
        total = total + sum(((measured[k][i] - x[i]) / sigma[i]) ** 2 for i in range(N_OUTPUTS))
        for _ in range(steps):
            k_1 = f(x, inputs[k])
            k_2 = f(ahead(x, k_1, h / 2), inputs[k])
            k_3 = f(ahead(x, k_2, h / 2), inputs[k])
            k_4 = f(ahead(x, k_3, h), inputs[k])
            stages = zip(x, k_1, k_2, k_3, k_4, strict=True)
            x = [a + h / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in stages]
        if not np.all(np.isfinite(x)):
            return math.inf
    return float(np.sum(total))
