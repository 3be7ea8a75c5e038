"""The output-error problem as a sparse program for IPOPT, with a Gauss-Newton Hessian.

Unknowns are θ and the states x_k where the intervals begin. The constraints are those of the
dynamics, x_{k+1} = F(x_k, w_k, θ); cost, gradient and Hessian are sums over the intervals of what
`IntervalFunctions` accumulates.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.estimation.output_error.shooting.interval import triangle_index
from pneumo_casadi.estimation.output_error.shooting.problem import (
    Problem,
    Unknowns,
    evaluate_intervals,
)
from pneumo_casadi.estimation.output_error.solvers.solution import Solution
from pneumo_casadi.model.machine_code.calls import mapped
from pneumo_casadi.parameters import FloatArray

#: Scaled infeasibility, primal and dual, at which steps below rounding are the end: what IPOPT
#: calls acceptable where it comes no further in many iterations.
ACCEPTABLE = 1e-6


def scales(problem: Problem) -> FloatArray:
    """Return the sizes of all unknowns z = [θ_free; x], shape (nz,)."""
    return np.concatenate([problem.free_scales, np.tile(problem.model.state_scales, problem.I)])


def pack(problem: Problem, point: Unknowns) -> FloatArray:
    """Return the scaled unknowns z of a point."""
    free = point.theta[problem.parameters.free_mask]
    packed: FloatArray = np.concatenate([free, point.x.ravel("F")]) / scales(problem)
    return packed


def unpack(problem: Problem, z: FloatArray, theta: FloatArray) -> Unknowns:
    """Return the point of scaled unknowns, the fixed parameters taken from `theta`."""
    unknowns = np.asarray(z, dtype=float).ravel() * scales(problem)
    parameters = problem.parameters
    mask = parameters.free_mask
    full = theta.copy()
    n = int(mask.sum())
    # An interior-point method relaxes bounds by about 1e-8; a parameter may not.
    full[mask] = np.clip(unknowns[:n], parameters.lower[mask], parameters.upper[mask])
    return Unknowns(full, unknowns[n:].reshape(problem.model.nx, -1, order="F"))


def bounds(problem: Problem) -> tuple[FloatArray, FloatArray]:
    """Return the bounds of the scaled unknowns; filters of a controller start as measured."""
    mask, n = problem.parameters.free_mask, len(problem.free)
    size = scales(problem)
    lower, upper = np.full(size.size, -np.inf), np.full(size.size, np.inf)
    lower[:n], upper[:n] = problem.parameters.lower[mask], problem.parameters.upper[mask]
    own, nx = problem.model.n_initial, problem.model.nx
    for first, segment in zip(problem.firsts, problem.segments, strict=True):
        at = slice(n + nx * first + own, n + nx * (first + 1))
        lower[at] = upper[at] = segment.x[own:, 0]
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
        lower, upper = bounds(self.problem)
        p = np.concatenate([point.theta, 1 / sigma**2])
        z = pack(self.problem, point)
        answer = self.solver(x0=z, p=p, lbx=lower, ubx=upper, lbg=0.0, ubg=0.0)
        stats = self.solver.stats()
        status = stats["return_status"]
        if status == "User_Requested_Stop":
            raise KeyboardInterrupt
        ended = unpack(self.problem, answer["x"], point.theta)
        good = status in ("Solve_Succeeded", "Solved_To_Acceptable_Level") or _at_rounding(stats)
        return Solution(
            ended,
            evaluate_intervals(self.problem, ended)[1],
            sigma,
            "converged" if good else str(status).replace("_", " ").lower(),
            int(stats["iter_count"]),
        )


def _at_rounding(stats: dict[str, Any]) -> bool:
    """Tell whether IPOPT gave up where rounding alone keeps it from its tolerance.

    Begun at the optimum of a cost of 0.2, say, its steps are below 1e-14 while the gradient keeps
    1e-8 of rounding, more on one processor than on another.
    """
    if stats["return_status"] != "Search_Direction_Becomes_Too_Small":
        return False
    return all(stats["iterations"][name][-1] < ACCEPTABLE for name in ("inf_pr", "inf_du"))


@dataclass(frozen=True, slots=True)
class Program:
    """The functions that a nonlinear solver asks for; all take (z, p) with p = [θ; 1/σ²]."""

    nlp: dict[str, Any]
    grad_f: ca.Function
    jac_g: ca.Function
    hess_lag: ca.Function


@dataclass(frozen=True, slots=True)
class _Written:
    """Symbols of the program and what all its functions share."""

    z: ca.MX
    p: ca.MX
    theta: ca.MX
    x: ca.MX
    weight: ca.MX
    selection: ca.DM


def program(problem: Problem) -> Program:
    """Write a problem as CasADi functions with hand-assembled sparse derivatives."""
    at = _symbols(problem)
    parameters, data, ny = problem.parameters, problem.data, len(problem.axis.outputs)
    value = mapped(problem.functions.value, problem.I)
    w, h, y = ca.DM(data.w), ca.DM(data.h), ca.DM(data.y)
    ends, m = value(at.x, w, at.theta, h)
    g = _defects(problem, ends, at.x)
    real = ca.DM(data.real.astype(float)[None])
    e = (y - m) * ca.repmat(real, ny, 1)
    f = 0.5 * ca.dot(ca.sum2(e**2), at.weight)

    full = mapped(problem.functions.sensitivity, problem.I)
    ends, _, S, JtJ, Jte, _ = full(at.x, w, at.theta, h, y, at.weight)
    map_gradient = ca.MX.zeros(len(problem.free))
    map_hessian = ca.MX.zeros(len(problem.free), len(problem.free))
    n_map = 0
    if problem.anchor is not None:
        c_at = [parameters.index(name) for name in problem.anchor.names]
        r, J = problem.anchor.residual(at.theta[c_at])
        # Columns of fixed coefficients fall out through `place`.
        J_free = J @ at.selection[c_at, :] @ ca.diag(ca.DM(problem.free_scales))
        f = f + 0.5 * ca.sumsqr(r)
        map_gradient, map_hessian, n_map = J_free.T @ r, J_free.T @ J_free, problem.anchor.n
    count = problem.n_blocks * problem.n * ny + n_map
    gradient = _gradient(problem, Jte, at.weight, map_gradient)
    hessian = _hessian(problem, JtJ, at.weight, map_hessian)
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.shape[0])
    given = [at.z, at.p]
    return Program(
        {"x": at.z, "p": at.p, "f": f / count, "g": g},
        # The solver reads the gradient as a dense vector, whatever its pattern says.
        ca.Function("grad_f", given, [f / count, ca.densify(gradient) / count]),
        ca.Function("jac_g", given, [_defects(problem, ends, at.x), _jacobian(problem, S)]),
        ca.Function("hess_lag", [*given, lam_f, lam_g], [lam_f * hessian / count]),
    )


def _symbols(problem: Problem) -> _Written:
    parameters, n_theta, n_free = problem.parameters, len(problem.parameters), len(problem.free)
    size = scales(problem)
    z = ca.MX.sym("z", size.size)
    p = ca.MX.sym("p", n_theta + len(problem.axis.outputs))
    unknowns = z * ca.DM(size)
    selection = ca.DM(np.eye(n_theta)[:, parameters.free_mask])
    fixed = ca.DM((~parameters.free_mask).astype(float))
    theta = p[:n_theta] * fixed + selection @ unknowns[:n_free]
    x = ca.reshape(unknowns[n_free:], problem.model.nx, problem.I)
    return _Written(z, p, theta, x, problem.n * p[n_theta:], selection)


def _defects(problem: Problem, ends: ca.MX, x: ca.MX) -> ca.MX:
    joins = problem.joined.tolist()
    d = ends[:, joins] - x[:, [i + 1 for i in joins]]
    return ca.vec(d / ca.repmat(ca.DM(problem.model.state_scales), 1, len(joins)))


def _gradient(problem: Problem, Jte: ca.MX, weight: ca.MX, map_gradient: ca.MX) -> ca.MX:
    """Gather -Jᵀe of all intervals, to θ and to their own nodes."""
    nx, count, each = problem.model.nx, problem.I, _weighed(Jte, weight)
    size = ca.DM(problem.model.state_scales)
    to_theta = ca.sum2(each[nx:, :]) * ca.DM(problem.free_scales)
    return -ca.vertcat(to_theta - map_gradient, ca.vec(each[:nx, :] * ca.repmat(size, 1, count)))


def _weighed(stacked: ca.MX, weight: ca.MX) -> ca.MX:
    """Return the weighted sum over the outputs, whose columns follow each other in an interval."""
    ny, columns = weight.shape[0], range(stacked.shape[1])
    total = ca.MX.zeros(stacked.shape[0], len(columns) // ny)
    for i in range(ny):
        total = total + weight[i] * stacked[:, list(columns[i::ny])]
    return total


def _hessian(problem: Problem, JtJ: ca.MX, weight: ca.MX, map_hessian: ca.MX) -> ca.MX:
    """Gather JᵀJ of all intervals: θ with θ, and every node with θ and itself (upper half)."""
    nx, n_free, count = problem.model.nx, len(problem.free), problem.I
    m, size = nx + n_free, scales(problem)
    blocks = _weighed(JtJ, weight)[triangle_index(m).ravel().tolist(), :]
    flat = ca.vec(blocks)
    total = ca.reshape(ca.sum2(blocks), m, m)[nx:, nx:]
    theta_scales = np.outer(problem.free_scales, problem.free_scales)
    theta_block = total * ca.DM(theta_scales) + map_hessian
    source = ca.vertcat(ca.vec(theta_block), flat)
    i, j = np.triu_indices(n_free)
    rows, columns, origin = [i], [j], [i + n_free * j]
    scale = [np.ones(i.size)]
    k, a, b = (part.ravel() for part in np.mgrid[:count, :m, :nx])
    own = a < nx
    keep = ~own | (a <= b)
    k, a, b, own = k[keep], a[keep], b[keep], own[keep]
    row = np.where(own, n_free + nx * k + a, a - nx)
    column = n_free + nx * k + b
    rows.append(row)
    columns.append(column)
    origin.append(n_free**2 + a + m * b + m * m * k)
    scale.append(size[row] * size[column])
    return _sparse(source, (size.size, size.size), rows, columns, origin, scale)


def _jacobian(problem: Problem, S: ca.MX) -> ca.MX:
    """Gather the intervals' sensitivities into the Jacobian of the joins."""
    nx, n_free, m = problem.model.nx, len(problem.free), problem.model.nx + len(problem.free)
    size, joins = scales(problem), problem.joined
    source = ca.vertcat(ca.vec(S), -1)
    join, i, j = (part.ravel() for part in np.mgrid[: joins.size, :nx, :m])
    row = join * nx + i
    column = np.where(j < nx, n_free + nx * joins[join] + j, j - nx)
    origin = i + nx * (j + m * joins[join])
    join, i = (part.ravel() for part in np.mgrid[: joins.size, :nx])
    rows, columns = [row, join * nx + i], [column, n_free + nx * (joins[join] + 1) + i]
    origins = [origin, np.full(i.size, nx * m * problem.I)]
    scale = [
        size[c] / problem.model.state_scales[r % nx] for r, c in zip(rows, columns, strict=True)
    ]
    return _sparse(source, (joins.size * nx, size.size), rows, columns, origins, scale)


def _sparse(
    source: ca.MX,
    shape: tuple[int, int],
    rows: list[NDArray[Any]],
    columns: list[NDArray[Any]],
    origin: list[NDArray[Any]],
    scale: list[FloatArray],
) -> ca.MX:
    """Return a sparse matrix whose entries are scaled entries of `source`."""
    row, column, at, factor = (np.concatenate(part) for part in (rows, columns, origin, scale))
    order = np.lexsort((row, column))
    pointers = np.concatenate([[0], np.cumsum(np.bincount(column, minlength=shape[1]))])
    pattern = ca.Sparsity(*shape, pointers.tolist(), row[order].tolist())
    return ca.MX(pattern, source[at[order].tolist()] * ca.DM(factor[order]))
