"""GEKKO: moving-horizon mode on the sample grid with the local solvers."""

from importlib.metadata import version as installed

import numpy as np
from gekko import GEKKO

from peer_tools.estimation import N_OUTPUTS, STATE_SCALES, Answer, Estimation

#: Nodes of each collocation polynomial, the ends of the period included.
NODES = 4


def version() -> str:
    """Return the tool's version."""
    return str(installed("gekko"))


def build(problem: Estimation) -> tuple:
    """Write the model in scaled unknowns; a value in time holds up to its instant.

    The tool neither counts nor returns the first instant as it does the others: one period is put
    before the record, and the record begins with the second instant.
    """
    m = GEKKO(remote=False)
    m.time = problem.dt * np.arange(problem.N + 1)
    # u_k acts on the way from sample k to k + 1; what acted before the record is free to choose.
    before = np.vstack([problem.u[:1], problem.u[:1], problem.u[:-1]])
    y = np.vstack([problem.scaled_y[:1], problem.scaled_y])
    v = np.append(problem.scaled_states[:1, 3], problem.scaled_states[:, 3])
    plus = [m.Param(np.maximum(before[:, i], 0.0)) for i in range(2)]
    minus = [m.Param(np.minimum(before[:, i], 0.0)) for i in range(2)]
    theta = []
    for _ in problem.names:
        parameter = m.FV(1.0, lb=0.2, ub=5.0)
        parameter.STATUS = 1
        theta.append(parameter)
    x = []
    for i in range(N_OUTPUTS):
        # A measured variable counts at the samples alone; an objective would count at all nodes.
        parameter = m.CV(y[:, i], fixed_initial=False)
        parameter.FSTATUS = 1
        parameter.WMEAS = 0.5 * float(problem.weights[i]) ** 2
        parameter.MEAS_GAP = 0.0
        x.append(parameter)
    x.append(m.Var(v, fixed_initial=False))

    def q(valve: int, p: object) -> object:
        # Named: the flow is long, and GEKKO writes equations as text.
        return m.Intermediate(problem.flow(plus[valve], minus[valve], p))

    rates = problem.scaled_rates(x, q, theta, m.tanh)
    for state, rate in zip(x, rates, strict=True):
        m.Equation(state.dt() == rate)
    m.options.EV_TYPE = 2  # squares
    m.options.IMODE = 5
    m.options.NODES = NODES
    m.options.SOLVER = 3
    m.options.MAX_ITER = 200
    return m, theta, x


def solve(problem: Estimation, built: tuple) -> Answer:
    """Solve by IPOPT and read back the parameters and the first state."""
    m, theta, x = built
    try:
        m.solve(disp=False)
    finally:
        m.cleanup()
    values = np.array([item.NEWVAL for item in theta]) * problem.start
    x_0 = np.array([state.value[1] for state in x]) * STATE_SCALES
    told = "success" if m.options.APPSTATUS == 1 else "no success"
    return Answer(values, x_0, float(m.options.OBJFCNVAL), told, int(m.options.ITERATIONS))
