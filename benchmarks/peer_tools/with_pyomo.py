"""Pyomo: `pyomo.dae` collocation on the sample grid, solved by POUNCE as IPOPT would be."""

from bisect import bisect_left
from importlib.metadata import version as installed

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
import pyomo_pounce  # noqa: F401 - registers the solver

from peer_tools.estimation import N_OUTPUTS, STATE_SCALES, Answer, Estimation, polynomial

#: Radau points in each sampling period: order five. Two points cost 5 % of the cost here.
POINTS = 3


def version() -> str:
    """Return the tool's version."""
    return f"{installed('pyomo')} + {installed('pyomo-pounce')}"


def build(problem: Estimation) -> pyo.ConcreteModel:
    """Write the model in scaled unknowns; the element up to t_k holds the input of k - 1."""
    grid = [k * problem.dt for k in range(problem.N)]
    held = problem.flow_coefficients.tolist()
    start = problem.scaled_states
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=grid)
    m.i = pyo.RangeSet(0, 3)
    # Each period has its own copy of the parameters, tied to the next one's: columns that reach
    # through the whole record make the solver's memory grow as the square of its length.
    m.j, m.k = pyo.RangeSet(0, len(problem.names) - 1), pyo.RangeSet(0, problem.N - 2)
    m.theta = pyo.Var(m.j, m.k, initialize=1.0)

    def constant(m: pyo.ConcreteModel, j: int, k: int) -> object:
        return pyo.Constraint.Skip if k == 0 else m.theta[j, k] == m.theta[j, k - 1]

    m.constant = pyo.Constraint(m.j, m.k, rule=constant)

    def nearest(t: float) -> int:
        return min(int(t / problem.dt + 0.5), problem.N - 1)

    m.x = pyo.Var(m.i, m.t, initialize=lambda m, i, t: float(start[nearest(t), i]))
    m.dx = dae.DerivativeVar(m.x, wrt=m.t, initialize=0.0)

    def dynamics(m: pyo.ConcreteModel, i: int, t: float) -> object:
        if t == grid[0]:
            return pyo.Constraint.Skip  # the initial state is free
        k = bisect_left(grid, t) - 1

        def q(valve: int, p: object) -> object:
            return polynomial(held[k][valve], problem.z(p))

        theta = [m.theta[j, k] for j in m.j]
        x = [m.x[j, t] for j in m.i]
        return m.dx[i, t] == problem.scaled_rates(x, q, theta, pyo.tanh)[i]

    m.dynamics = pyo.Constraint(m.i, m.t, rule=dynamics)
    pyo.TransformationFactory("dae.collocation").apply_to(
        m, wrt=m.t, nfe=problem.N - 1, ncp=POINTS, scheme="LAGRANGE-RADAU"
    )
    y, w = problem.scaled_y.tolist(), problem.weights.tolist()
    squares = (
        (w[i] * (m.x[i, t] - y[k][i])) ** 2 for k, t in enumerate(grid) for i in range(N_OUTPUTS)
    )
    m.cost = pyo.Objective(expr=0.5 * pyo.quicksum(squares))
    return m


def solve(problem: Estimation, built: pyo.ConcreteModel) -> Answer:
    """Write the NL file, solve, read back."""
    result = pyo.SolverFactory("pounce", options={"presolve": "no"}).solve(built)
    theta = np.array([built.theta[j, 0].value for j in built.j]) * problem.start
    x_0 = np.array([built.x[i, 0.0].value for i in built.i]) * STATE_SCALES
    told = str(result.solver.termination_condition)
    return Answer(theta, x_0, pyo.value(built.cost), f"{told}: {result.solver.message}")
