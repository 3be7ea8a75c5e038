"""acados: every sample a stage, parameters as states without dynamics, HPIPM."""

import ctypes
import os
from importlib import metadata, resources
from pathlib import Path

import casadi as ca
import numpy as np

root = Path(str(resources.files("acados")))
os.environ["ACADOS_SOURCE_DIR"] = str(root / "install")
os.environ["ACADOS_PYTHON_INTERFACE_PATH"] = str(root / "acados_template")
os.environ["TERA_PATH"] = str(root / "install" / "bin" / "t_renderer")
# The wheel's libraries do not say where the others are.
for name in ("libblasfeo.so", "libhpipm.so", "libqpOASES_e.so.3.1"):
    ctypes.CDLL(str(root / "install" / "lib" / name), ctypes.RTLD_GLOBAL)

from acados.acados_template import AcadosModel, AcadosOcp, AcadosOcpSolver  # noqa: E402

from peer_tools.estimation import N_OUTPUTS, STATE_SCALES, Answer, Estimation  # noqa: E402

#: Stages that HPIPM is given after partial condensing.
CONDENSED = 40
ITERATIONS = 50
#: Gradient of the Lagrangian in scaled unknowns at which a point counts as optimal: by the default
#: tolerance it goes on at the optimum until the iterations are exhausted.
STATIONARY = 10.0


def version() -> str:
    """Return the tool's version: that of the wheel."""
    return metadata.version("comma-deps-acados")


def build(problem: Estimation) -> AcadosOcpSolver:
    """Write, compile and load the solver."""
    nx, n = STATE_SCALES.size, len(problem.names)
    x, u = ca.SX.sym("x", nx + n), ca.SX.sym("u", 2)
    plus, minus = [ca.fmax(u[i], 0) for i in range(2)], [ca.fmin(u[i], 0) for i in range(2)]

    def q_of(i: int, p: ca.SX) -> ca.SX:
        return problem.flow(plus[i], minus[i], p)

    states, theta = ca.vertsplit(x[:nx]), ca.vertsplit(x[nx:])
    rates = problem.scaled_rates(states, q_of, theta, ca.tanh)
    model = AcadosModel()
    model.name = "peer"
    model.x, model.p, model.u = x, u, ca.SX.sym("no_input", 0)
    model.f_expl_expr = ca.vertcat(*rates, ca.SX.zeros(n))
    model.cost_y_expr = model.cost_y_expr_0 = model.cost_y_expr_e = x[:N_OUTPUTS]
    ocp = AcadosOcp()
    ocp.model = model
    ocp.dims.N = problem.N - 1
    ocp.parameter_values = np.zeros(2)
    # A stage's cost counts times its length, the last one's as it is.
    for end, length in (("", problem.dt), ("_0", problem.dt), ("_e", 1.0)):
        setattr(ocp.cost, f"cost_type{end}", "NONLINEAR_LS")
        setattr(ocp.cost, f"W{end}", np.diag(problem.weights**2) / length)
        setattr(ocp.cost, f"yref{end}", np.zeros(N_OUTPUTS))
    options = ocp.solver_options
    options.tf = (problem.N - 1) * problem.dt
    options.integrator_type = "ERK"
    options.sim_method_num_stages, options.sim_method_num_steps = 4, problem.steps
    options.nlp_solver_type, options.hessian_approx = "SQP", "GAUSS_NEWTON"
    options.nlp_solver_max_iter = ITERATIONS
    options.nlp_solver_tol_stat = STATIONARY
    options.qp_solver = "PARTIAL_CONDENSING_HPIPM"
    options.qp_solver_cond_N = min(CONDENSED, problem.N - 1)
    options.print_level = 0
    folder = Path(os.environ.get("TMPDIR", "/tmp")) / "acados"
    ocp.code_export_directory = str(folder / "code")
    folder.mkdir(exist_ok=True)
    # What was compiled for this problem before is used again.
    fresh = not list(folder.glob("code/libacados_ocp_solver_*.so"))
    described = str(folder / "ocp.json")
    return AcadosOcpSolver(ocp, described, build=fresh, generate=fresh, verbose=False)


def solve(problem: Estimation, built: AcadosOcpSolver) -> Answer:
    """Set data and start of every stage, then iterate."""
    nx = STATE_SCALES.size
    theta = np.ones(len(problem.names))
    for k, (x, y, u) in enumerate(
        zip(problem.scaled_states, problem.scaled_y, problem.u, strict=True)
    ):
        built.set(k, "x", np.concatenate([x, theta]))
        built.set(k, "yref", y)
        built.set(k, "p", u)
    status = built.solve()
    found = built.get(0, "x")
    iterations = int(np.ravel(built.get_stats("sqp_iter"))[0])
    values = found[nx:] * problem.start
    return Answer(
        values, found[:nx] * STATE_SCALES, built.get_cost(), f"status {status}", iterations
    )
