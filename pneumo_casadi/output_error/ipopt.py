"""The output-error problem as a sparse program for IPOPT, with a constant Gauss-Newton Hessian.

Unknowns are θ, the states x_k at all nodes, and the model's mean outputs m_k. With m_k lifted
into the unknowns the measurement residuals are linear, so the Gauss-Newton Hessian is a constant
diagonal plus the block of the flow map, and all nonlinearity sits in the constraints

    x_{k+1} = F(x_k, w_k, θ),    m_k = H(x_k, w_k, θ).
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

from pneumo_casadi.output_error.problem import Problem, Unknowns
from pneumo_casadi.output_error.solution import Solution
from pneumo_casadi.parameters import FloatArray


def scales(problem: Problem) -> FloatArray:
    """Return the sizes of all unknowns z = [θ_free; x; m], shape (nz,)."""
    states = np.tile(problem.axis.state_scales, problem.n_nodes)
    outputs = np.tile(problem.output_scales, problem.n_blocks)
    return np.concatenate([problem.free_scales, states, outputs])


def _pack(problem: Problem, point: Unknowns) -> FloatArray:
    free = point.theta[problem.parameters.free_mask]
    z = np.concatenate([free, point.x.ravel("F"), point.m.ravel("F")])
    packed: FloatArray = z / scales(problem)
    return packed


def _unpack(problem: Problem, z: FloatArray, theta: FloatArray) -> Unknowns:
    values = np.asarray(z, dtype=float).ravel() * scales(problem)
    parameters = problem.parameters
    mask = parameters.free_mask
    full = theta.copy()
    n, nx = int(mask.sum()), len(problem.axis.states)
    # An interior-point method relaxes bounds by about 1e-8; a parameter may not.
    full[mask] = np.clip(values[:n], parameters.lower[mask], parameters.upper[mask])
    x = values[n : n + nx * problem.n_nodes].reshape(nx, -1, order="F")
    m = values[n + nx * problem.n_nodes :].reshape(len(problem.axis.outputs), -1, order="F")
    return Unknowns(full, x, m)


def _bounds(problem: Problem) -> tuple[FloatArray, FloatArray]:
    mask = problem.parameters.free_mask
    size = scales(problem)
    lower, upper = np.full(size.size, -np.inf), np.full(size.size, np.inf)
    n = int(mask.sum())
    lower[:n] = problem.parameters.lower[mask]
    upper[:n] = problem.parameters.upper[mask]
    return lower / size, upper / size


class IpoptSolver:
    """IPOPT on one problem, built once and solved for any width, noise and start.

    Parameters
    ----------
    problem : Problem
        What to solve.
    max_iterations : int
        Of IPOPT.
    tolerance : float
        Of IPOPT, on the scaled optimality error.
    """

    def __init__(
        self, problem: Problem, max_iterations: int = 100, tolerance: float = 1e-8
    ) -> None:
        self.problem = problem
        written = program(problem)
        settings: dict[str, Any] = {
            "print_level": 0,
            "sb": "yes",
            "max_iter": max_iterations,
            "tol": tolerance,
            # The start lies inside its bounds and near the optimum. Multipliers of one, as by
            # default, would outweigh the data in the first steps and throw them off.
            "mu_init": 1e-8,
            "bound_mult_init_method": "mu-based",
        }
        self.solver = ca.nlpsol(
            "output_error",
            "ipopt",
            written.nlp,
            {
                "grad_f": written.grad_f,
                "jac_g": written.jac_g,
                "hess_lag": written.hess_lag,
                "ipopt": settings,
                "print_time": False,
                "show_eval_warnings": False,
                "error_on_fail": False,
                "calc_lam_p": False,
                "calc_lam_x": False,
                "no_nlp_grad": True,
            },
        )

    def solve(self, point: Unknowns, sigma: FloatArray) -> Solution:
        """Solve from a start; its θ holds the values of the fixed parameters."""
        lower, upper = _bounds(self.problem)
        p = np.concatenate([point.theta, 1 / sigma**2])
        z = _pack(self.problem, point)
        found = self.solver(x0=z, p=p, lbx=lower, ubx=upper, lbg=0.0, ubg=0.0)
        stats = self.solver.stats()
        status = stats["return_status"]
        if status == "User_Requested_Stop":
            raise KeyboardInterrupt
        good = status in ("Solve_Succeeded", "Solved_To_Acceptable_Level")
        return Solution(
            _unpack(self.problem, found["x"], point.theta),
            sigma,
            "converged" if good else str(status).replace("_", " ").lower(),
            int(stats["iter_count"]),
        )


@dataclass(frozen=True, slots=True)
class Program:
    """The functions that a nonlinear solver asks for; all take (z, p) with p = [θ; 1/σ²]."""

    nlp: dict[str, Any]
    grad_f: ca.Function
    jac_g: ca.Function
    hess_lag: ca.Function


def program(problem: Problem) -> Program:
    """Write a problem as CasADi functions with hand-assembled sparse derivatives."""
    parameters, axis, blocks = problem.parameters, problem.axis, problem.blocks
    nx, ny, n_free = len(axis.states), len(axis.outputs), len(problem.free)
    K, nodes, n_theta = problem.n_blocks, problem.n_nodes, len(parameters)
    size = scales(problem)
    z, p = ca.MX.sym("z", size.size), ca.MX.sym("p", n_theta + ny)
    values = z * ca.DM(size)
    at = np.flatnonzero(parameters.free_mask)
    place = ca.DM(sparse.csc_matrix((np.ones(n_free), (at, range(n_free))), (n_theta, n_free)))
    fixed = ca.DM((~parameters.free_mask).astype(float))
    theta = p[:n_theta] * fixed + place @ values[:n_free]
    x = ca.reshape(values[n_free : n_free + nx * nodes], nx, nodes)
    m = ca.reshape(values[n_free + nx * nodes :], ny, K)
    starts = problem.starts
    w = ca.DM(problem.w)

    value, _ = problem.mapped
    ends, y = value(x[:, starts.tolist()], w, theta)
    row_scale = np.concatenate([axis.state_scales, problem.output_scales])
    defect = ca.vertcat(ends - x[:, (starts + 1).tolist()], y - m) / ca.DM(row_scale)
    g = ca.vec(defect)

    count = K * blocks.n * ny + (problem.anchor.n if problem.anchor else 0)
    e = ca.DM(problem.y) - m
    f = 0.5 * blocks.n * ca.sum1(ca.sum2(e**2) * p[n_theta:])
    df_dm = -blocks.n * e * ca.repmat(p[n_theta:], 1, K)
    theta_gradient = ca.MX.zeros(n_free)
    hessian_map = ca.MX(n_free, n_free)
    if problem.anchor is not None:
        c_at = [parameters.index(name) for name in problem.anchor.names]
        r, J = problem.anchor.residual(theta[c_at])
        # Columns of fixed coefficients fall out through `place`.
        J_free = J @ place[c_at, :] @ ca.diag(ca.DM(problem.free_scales))
        f = f + 0.5 * ca.sumsqr(r)
        theta_gradient = J_free.T @ r
        hessian_map = J_free.T @ J_free
    gradient = ca.vertcat(
        theta_gradient,
        ca.MX.zeros(nx * nodes),
        ca.vec(df_dm) * ca.DM(np.tile(problem.output_scales, K)),
    )
    curvature = np.tile(blocks.n * problem.output_scales**2, K)
    weights = ca.vec(ca.repmat(p[n_theta:], 1, K)) * ca.DM(curvature)
    hessian = ca.diagcat(
        ca.triu(ca.densify(hessian_map)), ca.MX(nx * nodes, nx * nodes), ca.diag(weights)
    )
    jac_g = _constraint_jacobian(problem, x[:, starts.tolist()], w, theta, row_scale)
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.shape[0])
    return Program(
        {"x": z, "p": p, "f": f / count, "g": g},
        # The solver reads the gradient as a dense vector, whatever its pattern says.
        ca.Function("grad_f", [z, p], [f / count, ca.densify(gradient) / count]),
        ca.Function("jac_g", [z, p], [g, jac_g]),
        ca.Function("hess_lag", [z, p, lam_f, lam_g], [lam_f * hessian / count]),
    )


def _constraint_jacobian(
    problem: Problem, starts_x: ca.MX, w: ca.DM, theta: ca.MX, row_scale: FloatArray
) -> ca.MX:
    """Gather the blocks' sensitivities into the sparse Jacobian of all constraints."""
    nx, ny, n_free = len(problem.axis.states), len(problem.axis.outputs), len(problem.free)
    K, rows = problem.n_blocks, nx + ny
    size = scales(problem)
    _, sensitivity = problem.mapped
    _, _, dx, dy = sensitivity(starts_x, w, theta)
    source = ca.vertcat(ca.vec(dx), ca.vec(dy), -1)

    block, i, j = (a.ravel() for a in np.mgrid[:K, :rows, : nx + n_free])
    start_column = n_free + nx * np.asarray(problem.starts)[block]
    column = np.where(j < nx, start_column + j, j - nx)
    row = block * rows + i
    in_x = i + nx * (j + (nx + n_free) * block)
    in_y = nx * (nx + n_free) * K + (i - nx) + ny * (j + (nx + n_free) * block)
    origin = np.where(i < nx, in_x, in_y)

    block, i = (a.ravel() for a in np.mgrid[:K, :rows])
    end_column = n_free + nx * (np.asarray(problem.starts)[block] + 1) + i
    m_column = n_free + nx * problem.n_nodes + ny * block + (i - nx)
    row = np.concatenate([row, block * rows + i])
    column = np.concatenate([column, np.where(i < nx, end_column, m_column)])
    origin = np.concatenate([origin, np.full(block.size, (nx + ny) * (nx + n_free) * K)])

    order = np.lexsort((row, column))
    scale = size[column] / row_scale[row % rows]
    shape = (K * rows, size.size)
    pointers = np.concatenate([[0], np.cumsum(np.bincount(column, minlength=shape[1]))])
    pattern = ca.Sparsity(*shape, pointers.tolist(), row[order].tolist())
    return ca.MX(pattern, source[origin[order].tolist()] * ca.DM(scale[order]))
