"""The same problem stage by stage for solvers of CasADi that exploit the structure of time.

States and parameters run along together, s = (x, θ) with θ_{k+1} = θ_k, from block to block of
samples; the Hessian is that of Gauss-Newton, one dense block a stage.
"""

from typing import Any

import casadi as ca
import numpy as np

from peer_tools.estimation import N_OUTPUTS, STATE_SCALES, Answer, Estimation

#: Samples between two shooting nodes.
BLOCK = 2
#: Runge-Kutta steps of order four a sample.
STEPS = 2


def version() -> str:
    """Return the tool's version."""
    return str(ca.CasadiMeta.version())


def stage(problem: Estimation) -> ca.Function:
    """Return a block of samples, (s, openings and measurements) → (s after it, residuals)."""
    n = len(problem.names)
    s, data = ca.SX.sym("s", 4 + n), ca.SX.sym("data", 4 + N_OUTPUTS, BLOCK)
    theta = ca.vertsplit(s[4:])
    x, h = s[:4], problem.dt / STEPS
    residuals = []
    for k in range(BLOCK):
        opening = data[:4, k]

        def f(x: ca.SX, opening: ca.SX = opening) -> ca.SX:
            def q(valve: int, p: ca.SX) -> ca.SX:
                return problem.flow(opening[valve], opening[2 + valve], p)

            return ca.vcat(problem.scaled_rates(ca.vertsplit(x), q, theta, ca.tanh))

        residuals.append(ca.DM(problem.weights) * (x[:N_OUTPUTS] - data[4:, k]))
        for _ in range(STEPS):
            k_1 = f(x)
            k_2 = f(x + h / 2 * k_1)
            k_3 = f(x + h / 2 * k_2)
            k_4 = f(x + h * k_3)
            x = x + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)
    return ca.Function("stage", [s, data], [ca.vertcat(x, s[4:]), ca.vcat(residuals)])


def program(problem: Estimation, sign: float) -> tuple[dict[str, ca.MX], ca.Function, np.ndarray]:
    """Return the program, its Gauss-Newton Hessian and the start.

    `sign` is that of F(s_k) in the constraints between stages, on which solvers disagree.
    """
    F = stage(problem)
    K, size = problem.N // BLOCK, F.size1_in(0)
    u = problem.u[: K * BLOCK].T
    data = ca.DM(
        np.vstack([np.maximum(u, 0.0), np.minimum(u, 0.0), problem.scaled_y[: K * BLOCK].T])
    )
    z = ca.MX.sym("z", size * (K + 1))
    s = ca.reshape(z, size, K + 1)
    ahead, residuals = F.map(K)(s[:, :K], data)
    point, given = ca.SX.sym("s", size), ca.SX.sym("data", *F.size_in(1))
    J = ca.jacobian(F(point, given)[1], point)
    block = ca.Function("block", [point, given], [ca.densify(J.T @ J)])
    blocks = ca.vertcat(ca.vec(block.map(K)(s[:, :K], data)), ca.MX.zeros(size**2))
    pattern = ca.diagcat(*[ca.Sparsity.dense(size, size)] * (K + 1))
    lam_f, lam_g, p = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", size * K), ca.MX.sym("p", 0)
    hessian = ca.Function("hess_lag", [z, p, lam_f, lam_g], [lam_f * ca.MX(pattern, blocks)])
    nlp = {"x": z, "f": 0.5 * ca.sumsqr(residuals), "g": sign * ca.vec(ahead - s[:, 1:])}
    states = np.vstack([problem.scaled_states, problem.scaled_states[-1:]])[: K * BLOCK + 1 : BLOCK]
    return nlp, hessian, np.hstack([states, np.ones((K + 1, size - 4))]).ravel()


def answer(problem: Estimation, solver: ca.Function, start: np.ndarray) -> Answer:
    """Solve and read back the parameters and the first state."""
    result = solver(x0=start, lbg=0.0, ubg=0.0)
    first = np.asarray(result["x"]).ravel()[: 4 + len(problem.names)]
    told = solver.stats()
    status = f"{told['return_status']} (success: {told['success']})"
    theta, x_0 = first[4:] * problem.start, first[:4] * STATE_SCALES
    return Answer(theta, x_0, float(result["f"]), status, told.get("iter_count"))


def options(problem: Estimation) -> dict[str, Any]:
    """Return the sizes of all stages, as solvers with structure want them."""
    K, size = problem.N // BLOCK, 4 + len(problem.names)
    return {"N": K, "nx": [size] * (K + 1), "nu": [0] * (K + 1), "ng": [0] * (K + 1)}
