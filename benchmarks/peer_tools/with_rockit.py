"""rockit: multiple shooting from sample to sample, solved by IPOPT."""

from importlib.metadata import version as installed

import casadi as ca
import numpy as np
from rockit import MultipleShooting, Ocp

from peer_tools.estimation import N_OUTPUTS, STATE_SCALES, Answer, Estimation

#: Runge-Kutta steps of order four a sample.
STEPS = 2


def version() -> str:
    """Return the tool's version."""
    return str(installed("rockit-meco"))


def build(problem: Estimation) -> tuple:
    """Write the problem in scaled unknowns, inputs and measurements on the control grid."""
    N = problem.N
    ocp = Ocp(T=(N - 1) * problem.dt)
    # Vectors, not scalars: the tool's transcription takes time for every symbol.
    x, theta = ocp.state(4), ocp.variable(len(problem.names))
    opening = ocp.parameter(4, grid="control")  # max(u, 0) and min(u, 0)
    y = ocp.parameter(N_OUTPUTS, grid="control+")

    def q(valve: int, p: ca.MX) -> ca.MX:
        return problem.flow(opening[valve], opening[2 + valve], p)

    rates = problem.scaled_rates(ca.vertsplit(x), q, ca.vertsplit(theta), ca.tanh)
    ocp.set_der(x, ca.vcat(rates))
    ocp.set_initial(x, problem.scaled_states.T)
    ocp.set_initial(theta, 1.0)
    u = problem.u[: N - 1].T
    ocp.set_value(opening, np.vstack([np.maximum(u, 0.0), np.minimum(u, 0.0)]))
    ocp.set_value(y, problem.scaled_y.T)
    e = ca.DM(problem.weights) * (x[:N_OUTPUTS] - y)
    ocp.add_objective(0.5 * ocp.sum(ca.sumsqr(e), include_last=True))
    ocp.solver("ipopt", {"ipopt.print_level": 0, "print_time": False})
    ocp.method(MultipleShooting(N=N - 1, M=STEPS, intg="rk", intg_options={"expand": True}))
    return ocp, x, theta


def solve(problem: Estimation, built: tuple) -> Answer:
    """Solve and read back the parameters and the first state."""
    ocp, x, theta = built
    result = ocp.solve()
    values = np.array(result.value(theta)).ravel() * problem.start
    x_0 = np.array(result.sample(x, grid="control")[1][0]).ravel() * STATE_SCALES
    told = result.stats
    return Answer(
        values, x_0, result.value(ocp.objective), told["return_status"], told["iter_count"]
    )
