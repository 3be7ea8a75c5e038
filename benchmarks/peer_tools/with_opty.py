"""opty: direct collocation by the midpoint rule, solved by IPOPT through cyipopt."""

import numpy as np
import opty
import sympy
from scipy.interpolate import CubicSpline

from peer_tools.estimation import N_OUTPUTS, Answer, Estimation

#: Collocation intervals in each sampling period: the rule is of order two only.
INTERVALS = 4


def scales(problem: Estimation) -> np.ndarray:
    """Return sizes of the states by which the cost has unit curvature: the tool has no Hessian."""
    return np.append(problem.sigma, 100 * problem.sigma[-1])


def version() -> str:
    """Return the tool's version."""
    return str(opty.__version__)


def node_values(held: np.ndarray) -> np.ndarray:
    """Return values at nodes whose mean over each interval is what is held there.

    The rule takes an input midway between two nodes for the mean of both. The one freedom that is
    left, an alternating sign, is used to keep the values small.
    """
    sign = (-1.0) ** np.arange(held.size + 1)
    nodes = sign * np.concatenate([[0.0], np.cumsum(2 * held * -sign[:-1])])
    return nodes - sign * np.mean(sign * nodes)


def build(problem: Estimation) -> tuple:
    """Write the equations in SymPy, have them compiled, and set up the start."""
    t = sympy.Symbol("t")
    x = [sympy.Function(f"x_{i}")(t) for i in range(4)]
    opening = [sympy.Function(f"w_{i}")(t) for i in range(4)]  # max(u, 0), min(u, 0) by valve
    theta = list(sympy.symbols(f"theta_:{len(problem.names)}"))

    def q(valve: int, p: sympy.Expr) -> sympy.Expr:
        return problem.flow(opening[2 * valve], opening[2 * valve + 1], p)

    rates = problem.scaled_rates(x, q, theta, sympy.tanh, scales(problem))
    equations = sympy.Matrix([a.diff(t) - rate for a, rate in zip(x, rates, strict=True)])
    u = np.repeat(problem.u[:-1], INTERVALS, axis=0)
    held = [part(u[:, i], 0.0) for i in range(2) for part in (np.maximum, np.minimum)]
    n = len(u) + 1
    y = (problem.y / problem.sigma).T

    def measured(free: np.ndarray) -> np.ndarray:
        return free[: N_OUTPUTS * n].reshape(N_OUTPUTS, n)[:, ::INTERVALS]

    def objective(free: np.ndarray) -> float:
        return 0.5 * float(np.sum((measured(free) - y) ** 2))

    def gradient(free: np.ndarray) -> np.ndarray:
        slope = np.zeros_like(free)
        slope[: N_OUTPUTS * n].reshape(N_OUTPUTS, n)[:, ::INTERVALS] = measured(free) - y
        return slope

    program = opty.Problem(
        objective,
        gradient,
        equations,
        x,
        n,
        problem.dt / INTERVALS,
        known_trajectory_map={
            name: node_values(values) for name, values in zip(opening, held, strict=True)
        },
        time_symbol=t,
        integration_method="midpoint",
    )
    for name, value in (("print_level", 0), ("max_iter", 3000), ("linear_solver", "mumps")):
        program.add_option(name, value)
    time = np.arange(problem.N)
    fine = np.arange(n) / INTERVALS
    states = CubicSpline(time, problem.states / scales(problem))(fine)
    order = [str(name) for name in program.collocator.unknown_parameters]
    return program, states, [order.index(str(name)) for name in theta]


def solve(problem: Estimation, built: tuple) -> Answer:
    """Solve from the smoothed measurements; read back the parameters and the first state."""
    program, states, order = built
    start = np.concatenate([states.T.ravel(), np.ones(len(problem.names))])
    result, told = program.solve(start)
    n = len(states)
    theta = result[4 * n :][order] * problem.start
    x_0 = result[: 4 * n : n] * scales(problem)
    status = told["status_msg"]
    return Answer(
        theta,
        x_0,
        float(told["obj_val"]),
        status.decode() if isinstance(status, bytes) else str(status),
    )
