"""do-mpc: moving-horizon estimation with one horizon over the whole record, IPOPT."""

import warnings

import casadi as ca
import numpy as np

from peer_tools.estimation import N_OUTPUTS, STATE_SCALES, Answer, Estimation

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of optional parts that are not installed
    import do_mpc

STATES = ("p_P", "p_N", "x", "v")


def version() -> str:
    """Return the tool's version."""
    return str(do_mpc.__version__)


def _model(problem: Estimation) -> do_mpc.model.Model:
    """Write the model in scaled states and parameters; openings are known in time."""
    model = do_mpc.model.Model("continuous", "SX")
    x = [model.set_variable("_x", name) for name in STATES]
    theta = [model.set_variable("_p", name) for name in problem.names]
    opening = [model.set_variable("_tvp", f"opening_{i}") for i in range(4)]

    def q(valve: int, p: ca.SX) -> ca.SX:
        return problem.flow(opening[2 * valve], opening[2 * valve + 1], p)

    for name, rate in zip(STATES, problem.scaled_rates(x, q, theta, ca.tanh), strict=True):
        model.set_rhs(name, rate)
    for name, state in zip(STATES[:N_OUTPUTS], x, strict=False):
        model.set_meas(f"y_{name}", state, meas_noise=True)
    model.setup()
    return model


def build(problem: Estimation) -> do_mpc.estimator.MHE:
    """Write the horizon.

    The tool pairs the measurement of step k with the state at the *end* of step k: it is given
    y_1 ... y_{N-1} there, and y_0 as the weighted prior of the initial state.
    """
    model = _model(problem)
    mhe = do_mpc.estimator.MHE(model, list(problem.names))
    n = problem.N - 1
    mhe.settings.n_horizon = n
    mhe.settings.t_step = problem.dt
    mhe.settings.store_full_solution = False
    mhe.settings.meas_from_data = False
    mhe.settings.collocation_deg = 3
    mhe.settings.collocation_ni = 1
    mhe.settings.nlpsol_opts = {
        "ipopt.print_level": 0,
        "print_time": False,
        "ipopt.linear_solver": "mumps",
    }
    P = problem.weights**2 / 2
    mhe.set_default_objective(
        P_x=np.diag([*P, 0.0]), P_v=np.diag(P), P_p=np.zeros((len(problem.names),) * 2)
    )
    known, measured, fixed = mhe.get_tvp_template(), mhe.get_y_template(), mhe.get_p_template()
    u = problem.u  # the template of known inputs has one row more than there are steps
    # Whole vectors at once: element by element the templates take minutes.
    order = np.stack([np.maximum(u, 0.0), np.minimum(u, 0.0)], axis=2)  # (N, valve, sign)
    known = known.struct(ca.DM(order.reshape(-1)))
    measured = measured.struct(ca.DM(problem.scaled_y[1:].reshape(-1)))
    mhe.set_tvp_fun(lambda t: known)
    mhe.set_y_fun(lambda t: measured)
    mhe.set_p_fun(lambda t: fixed)
    mhe.setup()
    return mhe


def solve(problem: Estimation, built: do_mpc.estimator.MHE) -> Answer:
    """Start from the smoothed measurements and make one step of estimation."""
    built.x0 = np.array([*problem.scaled_y[0], problem.scaled_states[0, 3]])
    built.p_est0 = np.ones(len(problem.names))
    built.set_initial_guess()
    for k in range(problem.N):
        built.opt_x_num["_x", k] = [problem.scaled_states[k]] * len(built.opt_x_num["_x", k])
    # The tool takes the guess of the state after step 0 for the prior of the one before it.
    built.opt_x_num["_x", 1] = [built.x0.cat] * len(built.opt_x_num["_x", 1])
    built.make_step(problem.scaled_y[-1])
    theta = np.array(built.opt_x_num["_p_est"].full()).ravel() * problem.start
    x_0 = np.array(built.opt_x_num["_x", 0, -1].full()).ravel() * STATE_SCALES
    told = built.solver_stats
    objective = float(built.S.stats()["iterations"]["obj"][-1])
    return Answer(theta, x_0, objective, told["return_status"], told["iter_count"])
